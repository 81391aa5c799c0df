"""Millimetres on the participant's screen are millimetres: scaled desktops, screens on their side, turned axes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QApplication, QMessageBox, QWidget

from draglag.instruments.calibration import target_places
from draglag.recording import Screen
from draglag_app.windows import start
from draglag_app.windows.main import show_whole
from draglag_app.windows.participant import placement
from draglag_app.windows.settings import CalibrationSettings, PanelSettings
from draglag_devices.calibration import as_mapping

LYING, UPRIGHT = Screen("lying", 509.2, 286.4, 1920, 1080), Screen("upright", 286.4, 509.2, 1080, 1920)
PLACE_MM = (200.0, 100.0)

SHOW = """
import json, sys, time
import numpy as np
from PySide6.QtGui import QColor, QGuiApplication, QImage
from draglag.recording import Screen
from draglag.protocol.targets import Tap
from draglag_app.windows.application import make_application
from draglag_app.windows.participant.window import TARGET, ParticipantWindow
from draglag_app.windows.participant.screen_display import numbered_screen

application = make_application([])
seen = []
for number, panel in enumerate((Screen("", 509.2, 286.4, 1920, 1080), Screen("", 286.4, 509.2, 1080, 1920)), 1):
    window = ParticipantWindow(panel)
    window.show_on(numbered_screen(number))
    application.processEvents()
    window.show_target(Tap(200.0, 100.0, 5, 1.0), time.monotonic())
    image = window.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    data = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine() // 4, 4)
    colour = QColor(TARGET)
    near = np.abs(data[..., :3].astype(int) - [colour.blue(), colour.green(), colour.red()]).max(axis=2) < 40
    y, x = np.nonzero(near)
    seen.append({"px": [image.width(), image.height()], "centre": [x.mean() + 0.5, y.mean() + 0.5],
                 "size": [int(np.ptp(x)) + 1, int(np.ptp(y)) + 1]})
    window.close()
print(json.dumps(seen))
"""


@pytest.mark.parametrize("scale", [1.0, 1.25, 1.5, 2.0])
def test_a_target_is_where_and_as_large_as_it_should_be_on_scaled_and_upright_screens(
    scale: float, tmp_path: Path
) -> None:
    """Two screens of 1920×1080 and 1080×1920 pixels, as the platform without a window system has them."""
    screens = [
        {"name": "lying", "x": 0, "y": 0, "width": 1920, "height": 1080, "logicalDpi": 96},
        {"name": "upright", "x": 1920, "y": 0, "width": 1080, "height": 1920, "logicalDpi": 96},
    ]
    config = tmp_path / "screens.json"
    config.write_text(json.dumps({"screens": screens}))
    env = {
        **os.environ,
        "QT_QPA_PLATFORM": f"offscreen:configfile={config}",
        "QT_SCALE_FACTOR": str(scale),
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    done = subprocess.run([sys.executable, "-c", SHOW], env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for seen, panel in zip(json.loads(done.stdout), (LYING, UPRIGHT), strict=True):
        # Every pixel of the screen is used (to the rounding of a scaled size)…
        assert seen["px"] == pytest.approx([panel.width_px, panel.height_px], abs=2)
        # …so a place in mm is that share of them: half a millimetre is two pixels.
        mm_per_px = panel.width_mm / panel.width_px
        assert np.array(seen["centre"]) * mm_per_px == pytest.approx(PLACE_MM, abs=0.5)
        # A circle is as high as it is wide, 14 mm with its line.
        assert np.array(seen["size"]) * mm_per_px == pytest.approx([15.0, 15.0], abs=1.0)


@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
@pytest.mark.parametrize("panel", [LYING, UPRIGHT], ids=lambda panel: panel.name)
def test_touches_on_a_turned_screen_are_where_they_were_made(quarters: int, panel: Screen) -> None:
    """The axes stay with the glass: 0 … 32767 along its own edges, whichever way up the picture is."""
    x_mm, y_mm = target_places(panel.width_mm, panel.height_mm, 9)
    x_raw, y_raw = glass(x_mm, y_mm, quarters, panel)
    mapping = as_mapping(CalibrationSettings(address="evdev:x", x_raw=x_raw, y_raw=y_raw).fit(panel))
    somewhere = np.array([[20.0, 30.0], [250.0, 200.0], [111.0, 7.0]])
    raw = glass(*somewhere.T, quarters, panel)
    assert np.column_stack(mapping(np.array(raw[0]), np.array(raw[1]))) == pytest.approx(somewhere, abs=1e-6)


def glass(x_mm: np.ndarray, y_mm: np.ndarray, quarters: int, panel: Screen) -> tuple[tuple[float, ...], ...]:
    """Device units of a place on the picture, the glass turned by quarters against it."""
    u, v = x_mm / panel.width_mm, y_mm / panel.height_mm
    for _ in range(quarters):
        u, v = 1.0 - v, u
    return tuple(32767 * u), tuple(32767 * v)


class FakeScreen:
    def __init__(self, width: int, height: int, orientation: Qt.ScreenOrientation) -> None:
        self._size, self._orientation = QSize(width, height), orientation

    def size(self) -> QSize:
        return self._size

    def orientation(self) -> Qt.ScreenOrientation:
        return self._orientation

    def nativeOrientation(self) -> Qt.ScreenOrientation:
        return Qt.ScreenOrientation.LandscapeOrientation

    def primaryOrientation(self) -> Qt.ScreenOrientation:
        return Qt.ScreenOrientation.LandscapeOrientation


ON_SIDE = FakeScreen(1080, 1920, Qt.ScreenOrientation.PortraitOrientation)
NORMAL = FakeScreen(1536, 864, Qt.ScreenOrientation.LandscapeOrientation)  # scaled by 1.25


def test_a_panel_that_is_not_as_the_screen_stands_is_reported() -> None:
    assert placement.shape_problem(LYING, NORMAL) == ""
    assert placement.shape_problem(UPRIGHT, ON_SIDE) == ""
    assert "press Rotate 90°" in placement.shape_problem(LYING, ON_SIDE)
    assert "correct the numbers" in placement.shape_problem(Screen("", 300.0, 300.0, 900, 900), NORMAL)


def test_turned_axes_need_a_calibration() -> None:
    upside_down = FakeScreen(1920, 1080, Qt.ScreenOrientation.InvertedLandscapeOrientation)
    assert "calibrate" in placement.axes_problem(False, upside_down)
    assert "calibrate" in placement.axes_problem(False, ON_SIDE)
    assert placement.axes_problem(True, upside_down) == ""
    assert placement.axes_problem(False, NORMAL) == ""


def test_a_window_larger_than_the_screen_fills_it_and_hides_nothing(qapp: QApplication) -> None:
    room = qapp.primaryScreen().availableGeometry()
    large, small = QWidget(), QWidget()
    large.resize(room.width(), room.height())  # no room is left for its title bar
    small.resize(room.width() // 2, room.height() // 2)
    for window in (large, small):
        show_whole(window)
    assert large.isMaximized()
    assert not small.isMaximized()
    for window in (large, small):
        window.close()
        window.deleteLater()


def test_start_asks_when_the_screen_stands_on_its_side_and_rotating_mends_it(
    open_window: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window(rig={"touch": "replay:x.h5", "laser": "replay:x.h5", "walt": "sim:", "display": "screen 1"})
    monkeypatch.setattr(start, "numbered_screen", lambda number: ON_SIDE)
    asked: list[str] = []

    def question(parent: object, title: str, text: str, **more: object) -> QMessageBox.StandardButton:
        asked.append(text)
        assert more["defaultButton"] == QMessageBox.StandardButton.No
        return QMessageBox.StandardButton.No

    monkeypatch.setattr(QMessageBox, "question", question)
    window.start()
    assert "press Rotate 90°" in asked[0]
    assert not window.space.recording.active

    page = window.geometry_page
    page.rotate.click()
    panel = window.space.settings.panel.screen()
    assert (panel.width_mm, panel.height_mm, panel.width_px, panel.height_px) == (286.4, 509.2, 1080, 1920)
    assert start.obstacles(window.space) == []
    window.ask("undo")
    assert window.space.settings.panel == PanelSettings()
