"""Touch calibration in the operator's window, from the first cross to the session file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from draglag.errors import DataError
from draglag.instruments.calibration import target_places
from draglag.recording import AxisInfo, Screen, TouchTrace
from draglag.store import read_session
from draglag_app.calibrating import NO_UNITS, SAME_PLACE, SLID, TARGETS, TOO_SHORT, Touches, fit_touches, size_mismatch
from draglag_app.windows.settings import load_settings
from draglag_app.windows.window import OperatorWindow
from draglag_devices.calibration import load_calibration, load_touches
from draglag_devices.sim.world import DIGITISER
from draglag_devices.source import Batch, ContactChanges

AXES = (AxisInfo("x", 0, 10_000, 20), AxisInfo("y", 0, 6_000, 20))


def touch(x: float, y: float, k: int = 0, lasts_s: float = 0.4, slide: float = 0.0, raw: bool = True) -> Batch:
    """One contact, from going down to lifting."""
    t_s = 10.0 * k + np.arange(0, lasts_s, 0.01)
    x_raw = x + slide * np.linspace(0, 1, len(t_s))
    y_raw = np.full(len(t_s), float(y))
    trace = TouchTrace(t_s, x_raw, y_raw, np.full(len(t_s), k))
    if raw:
        trace = replace(trace, x_raw=x_raw, y_raw=y_raw)
    changes = ContactChanges(np.array([t_s[0], t_s[0] + lasts_s]), np.array([k, k]), np.array([1, 0]))
    return Batch(float(t_s[-1]) + 1, touch=trace, contacts=changes)


class TestWhatCountsAsATouch:
    def test_a_resting_stylus_is_taken_where_it_rested(self) -> None:
        touches = Touches(axes=AXES)
        assert touches.take(touch(1000, 600)) == [""]
        assert touches.found == [(1000, 600)]

    @pytest.mark.parametrize(
        ("second", "fault"),
        [
            (touch(5000, 600, 1, lasts_s=0.05), TOO_SHORT),
            (touch(5000, 600, 1, slide=900), SLID),
            (touch(1050, 620, 1), SAME_PLACE),
            (touch(5000, 600, 1, raw=False), NO_UNITS),
        ],
    )
    def test_others_are_not_and_say_why(self, second: Batch, fault: str) -> None:
        touches = Touches(axes=AXES)
        touches.take(touch(1000, 600))
        assert touches.take(second) == [fault]
        assert len(touches.found) == 1

    def test_a_touch_may_come_in_pieces_and_pause(self) -> None:
        whole = touch(3000, 2000)
        first = replace(whole, touch=_part(whole.touch, 0, 5), contacts=None)
        rest = replace(whole, touch=_part(whole.touch, 5, 40))
        touches = Touches(axes=AXES)
        assert touches.take(first) == []
        assert touches.take(rest) == [""]

    def test_one_back_asks_for_the_last_target_again(self) -> None:
        touches = Touches(axes=AXES)
        for k, x in enumerate((1000, 5000)):
            touches.take(touch(x, 600, k))
        touches.back()
        assert touches.found == [(1000, 600)]

    def test_a_size_that_the_resolution_contradicts_is_doubted(self) -> None:
        panel = Screen("s", 500.0, 300.0, 1920, 1080)
        x_mm, y_mm = target_places(panel.width_mm, panel.height_mm, TARGETS)
        fit = fit_touches(20 * y_mm, 20 * x_mm, panel)  # turned by a quarter
        assert size_mismatch(fit, (20, 20)) is None
        assert size_mismatch(fit, (20, 19)) == pytest.approx(0.05)
        assert size_mismatch(fit, (0, 0)) is None


def _part(trace: TouchTrace, a: int, b: int) -> TouchTrace:
    names = ("t_s", "x_mm", "y_mm", "contact_id", "x_raw", "y_raw")
    return TouchTrace(**{name: getattr(trace, name)[a:b] for name in names})


def calibrate(window: OperatorWindow, until: Callable) -> None:
    """The whole of it by keyboard: the action's key, and the simulated hand."""
    window.activateWindow()
    until(window.isActiveWindow)
    QTest.keyClick(window, Qt.Key.Key_K, Qt.KeyboardModifier.ControlModifier)
    assert window.space.calibrating.active
    until(lambda: not window.space.calibrating.active)


class TestInTheWindow:
    def test_nine_targets_give_the_digitisers_own_affine(self, open_window: Callable, until: Callable) -> None:
        window = open_window()
        calibrate(window, until)
        known = window.space.settings.panel.calibration
        screen = window.space.settings.panel.screen()
        fit = known.fit(screen)
        # The true mapping is the inverse of the digitiser's; an aim of 0.2 mm leaves about that much anywhere.
        x_mm, y_mm = target_places(screen.width_mm, screen.height_mm, TARGETS)
        (xx, xy, x0), (yx, yy, y0) = DIGITISER
        got = np.array(fit(xx * x_mm + xy * y_mm + x0, yx * x_mm + yy * y_mm + y0))
        assert np.abs(got - [x_mm, y_mm]).max() < 0.7
        assert 0.02 < fit.rms_mm < 0.7
        panel = window.geometry_page.calibration
        assert f"RMS {fit.rms_mm:.2f} mm" in panel.verdict.text()
        assert "9:\u00a0" in panel.figures.text()
        assert len(panel.picture.drawn["targets"][0]) == TARGETS

    def test_it_is_kept_undone_and_brought_back(self, open_window: Callable, until: Callable, tmp_path) -> None:
        window = open_window()
        calibrate(window, until)
        made = window.space.settings.panel.calibration
        assert load_settings(tmp_path / "settings.toml")[0].panel.calibration == made
        window.ask("undo")
        assert window.space.settings.panel.calibration is None
        assert "None" in window.geometry_page.calibration.verdict.text()
        window.ask("redo")
        assert window.space.settings.panel.calibration == made

    def test_it_is_saved_to_a_file_that_a_driver_reads(
        self, open_window: Callable, until: Callable, tmp_path, monkeypatch
    ) -> None:
        window = open_window()
        panel = window.geometry_page.calibration
        assert panel.save.isHidden()
        calibrate(window, until)
        assert not panel.save.isHidden()
        path = tmp_path / "touchscreen.json"
        monkeypatch.setattr("draglag_app.windows.parts.ask_files.pick_files", lambda *asked: asked[-1]([path]))
        panel.save.click()
        made = window.space.settings.panel.calibration
        fit, device = load_calibration(tmp_path / "touchscreen.json")
        assert device == made.device
        assert fit.matrix == pytest.approx(made.fit(window.space.settings.panel.screen()).matrix)
        assert load_touches(tmp_path / "touchscreen.json").x_raw == pytest.approx(made.x_raw)

    def test_a_session_is_mapped_with_it_and_keeps_it(self, open_window: Callable, until: Callable) -> None:
        window = open_window()
        calibrate(window, until)
        made = window.space.settings.panel.calibration
        screen = window.space.settings.panel.screen()
        window.ask("start")
        until(lambda: window.space.session is not None and not window.space.tasks.running)
        session = read_session(window.space.path)
        assert session.calibration is not None
        assert session.calibration.x_raw == pytest.approx(made.x_raw)
        assert session.calibration.matrix == pytest.approx(made.fit(screen).matrix)
        run = session.runs[0].touch
        x_mm, y_mm = made.fit(screen)(run.x_raw, run.y_raw)
        assert run.x_mm == pytest.approx(x_mm)
        assert run.y_mm == pytest.approx(y_mm)

    def test_a_bad_fit_is_refused_with_the_remedy_and_nothing_changes(
        self, open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        window = open_window()
        calibrating = window.space.calibrating
        place = calibrating._place_mm

        def off_target() -> tuple[float, float]:
            x_mm, y_mm = place()
            return x_mm + (12.0 if len(calibrating.touches.found) == 4 else 0.0), y_mm

        monkeypatch.setattr(calibrating, "_place_mm", off_target)
        calibrate(window, until)
        assert window.space.settings.panel.calibration is None
        assert "target 5 is off" in window.geometry_page.calibration.verdict.text()
        assert "again" in window.notice_text.text()

    def test_escape_on_the_participants_screen_ends_it(self, open_window: Callable, until: Callable) -> None:
        window = open_window()
        window.ask("calibrate")
        calibrating = window.space.calibrating
        until(lambda: len(calibrating.touches.found) >= 2)
        participant = calibrating.window
        assert "of 9" in participant._present_words()
        QTest.keyClick(participant, Qt.Key.Key_Backspace)
        assert calibrating.active
        QTest.keyClick(participant, Qt.Key.Key_Escape)
        assert not calibrating.active
        assert window.space.settings.panel.calibration is None
        assert window.isVisible()

    @pytest.mark.parametrize("address", ["", "csv:somewhere.csv", "evdev:/dev/input/event7"])
    def test_what_cannot_be_calibrated_is_reported(self, open_window: Callable, address: str) -> None:
        window = open_window(rig={"touch": address, "display": "window"})
        with pytest.raises(DataError, match="Bench"):
            window.space.calibrating.start(window.space.settings)
        window.ask("calibrate")
        assert "Bench" in window.notice_text.text()
        assert not window.space.calibrating.active

    def test_a_new_preset_forgets_the_calibration(self, open_window: Callable, until: Callable) -> None:
        window = open_window()
        calibrate(window, until)
        page = window.geometry_page
        page.preset.setCurrentIndex(page.preset.findData("screen-2"))
        page._preset_chosen()
        assert window.space.settings.panel.calibration is None
