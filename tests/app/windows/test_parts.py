"""Settings, actions, bridge, tasks, plots and protocol edits."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtWidgets import (
    QApplication,
    QWidget,
)

from draglag.errors import DataError
from draglag.protocol.runs import load_protocol
from draglag_app.session import events
from draglag_app.windows.actions import ACTIONS, key_list
from draglag_app.windows.bridge import SessionBridge
from draglag_app.windows.parts.tasks import Progress, Tasks
from draglag_app.windows.parts.theme import THEMES, style_sheet, theme
from draglag_app.windows.plots.plot import Plot
from draglag_app.windows.protocol_text import to_toml
from draglag_app.windows.settings import RigSettings, Settings, load_settings, save_settings
from draglag_app.windows.window import OperatorWindow
from draglag_resources import presets


class TestSettings:
    def test_they_come_back_as_saved(self, tmp_path: Path) -> None:
        path = tmp_path / "deep" / "settings.toml"
        settings = Settings(theme="light", operator="Zoë", rig=RigSettings(touch="sim:?seed=3"))
        save_settings(settings, path)
        assert load_settings(path) == (settings, "")

    @pytest.mark.parametrize(
        "text", ["theme = ", "theme = 'pink'", "[rig]\ntouch = 3", "\x00\x01", "[panel]\npreset = 'no-such-screen'"]
    )
    def test_a_bad_file_means_defaults_and_a_sentence(self, tmp_path: Path, text: str) -> None:
        path = tmp_path / "settings.toml"
        path.write_text(text, "utf-8")
        settings, sentence = load_settings(path)
        assert settings.rig == RigSettings()
        assert settings.panel.screen().width_mm > 0
        assert sentence.endswith(".")

    @pytest.mark.parametrize(
        ("text", "named"),
        [
            ("[rig]\ndisplay = 'screen x'\n", "rig.display"),
            ("folder = ''\n", "folder"),
            ("text_scale = 1e9\n[panel]\nwidth_mm = -3\n", "panel.width_mm, text_scale"),
            ("[panel.calibration]\naddress = 'evdev:x'\nx_raw = [1.0]\ny_raw = [1.0]\n", "calibration"),
        ],
    )
    def test_only_what_cannot_be_used_is_left_out_and_the_file_is_kept(
        self, tmp_path: Path, text: str, named: str
    ) -> None:
        path = tmp_path / "settings.toml"
        path.write_text("operator = 'Zoë'\n" + text, "utf-8")
        settings, sentence = load_settings(path)
        assert settings == Settings(operator="Zoë")
        assert named in sentence
        assert sentence.endswith("settings.toml.unusable.")
        assert (tmp_path / "settings.toml.unusable").read_text("utf-8") == path.read_text("utf-8")

    def test_a_protocol_that_is_gone_is_reported(self, tmp_path: Path) -> None:
        path = tmp_path / "settings.toml"
        path.write_text("protocol = '/no/such.toml'\n", "utf-8")
        assert "/no/such.toml" in load_settings(path)[1]

    def test_no_file_is_a_first_start(self, tmp_path: Path) -> None:
        settings, sentence = load_settings(tmp_path / "none.toml")
        assert settings.first_start
        assert sentence == ""

    def test_unknown_keys_of_later_versions_are_left_alone(self, tmp_path: Path) -> None:
        path = tmp_path / "settings.toml"
        path.write_text("later = 1\ntheme = 'light'\n", "utf-8")
        assert load_settings(path) == (Settings(theme="light"), "")

    def test_a_folder_that_cannot_be_made_is_reported(self, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        with pytest.raises(DataError, match="cannot be saved"):
            save_settings(Settings(), tmp_path / "file" / "settings.toml")


class TestActions:
    def test_keys_are_unique_and_every_action_has_one(self) -> None:
        keys = [spec.keys for spec in ACTIONS]
        assert all(keys)
        assert len(set(keys)) == len(keys)
        assert len(key_list({})) == len(ACTIONS)

    def test_every_action_but_a_missing_page_is_there(self, open_window: Callable[..., OperatorWindow]) -> None:
        window = open_window()
        missing = {spec.id for spec in ACTIONS} - set(window.actions_table.made)
        assert missing <= {"go_gap"}
        for name, (title, page) in window.pages.items():
            window.ask(f"go_{name}")
            assert window.stack.currentWidget() is page
            assert window.navigation.tabs[name].text() == title


class TestThreads:
    def test_bridge_delivers_everything_in_order_in_the_windows_thread(
        self, qapp: QApplication, until: Callable
    ) -> None:
        bridge = SessionBridge()
        got: list[tuple[float, bool]] = []
        main = threading.get_ident()
        bridge.notice_raised.connect(lambda event: got.append((event.t_s, threading.get_ident() == main)))

        def talk() -> None:
            for k in range(5000):
                bridge.listener(events.NoticeRaised(float(k), "info", "test", ""))

        thread = threading.Thread(target=talk, name="draglag-test")
        thread.start()
        until(lambda: len(got) == 5000)
        thread.join()
        assert got == [(float(k), True) for k in range(5000)]

    def test_tasks_report_in_the_windows_thread(self, qapp: QApplication, until: Callable) -> None:
        tasks, got, main = Tasks(), [], threading.get_ident()

        def work(progress: Progress) -> bool:
            progress(0.5, "half")
            return threading.get_ident() != main

        tasks.start("x", work, lambda away: got.append((away, threading.get_ident() == main)), pytest.fail)
        until(lambda: not tasks.running)
        assert got == [(True, True)]
        tasks.finish()

    def test_faults_become_sentences(self, qapp: QApplication, until: Callable) -> None:
        tasks, reported = Tasks(), []

        def fails(progress: Progress) -> None:
            raise DataError("the file is gone", "find it")

        def breaks(progress: Progress) -> None:
            raise ZeroDivisionError("by nothing")

        for work in (fails, breaks):
            tasks.start("Reading", work, lambda result: pytest.fail("no result"), reported.append)
        until(lambda: not tasks.running)
        assert reported == [str(DataError("the file is gone", "find it")), "Reading: by nothing"]
        tasks.finish()

    def test_cancelled_work_ends_at_its_next_step_and_says_nothing(self, qapp: QApplication, until: Callable) -> None:
        tasks, reported, begun, steps = Tasks(), [], threading.Event(), []

        def work(progress: Progress) -> None:
            begun.set()
            while True:
                progress(0.0, "")
                steps.append(1)

        task = tasks.start("x", work, reported.append, reported.append)
        begun.wait()
        task.cancel()
        until(lambda: not tasks.running)
        assert reported == []
        tasks.finish()


class TestPlots:
    @pytest.fixture
    def plot(self, qapp: QApplication) -> Plot:
        made = Plot("title", "x (mm)", "y (mm)")
        made.add_legend()
        made.resize(400, 300)
        x = np.linspace(0, 1, 50)
        made.line("line", x, x**2, "#0072b2")
        made.dots("dots", x[::10], x[::10], "#e69f00", "s", error=0.1 * np.ones(5), words=["a"] * 5)
        made.band("band", x, x - 0.1, x + 0.1, "#009e73")
        yield made
        made.deleteLater()

    def test_svg(self, plot: Plot, tmp_path: Path) -> None:
        plot.save(tmp_path / "plot.svg")
        text = (tmp_path / "plot.svg").read_text("utf-8")
        assert "<svg" in text
        assert "x (mm)" in text

    def test_png(self, plot: Plot, tmp_path: Path) -> None:
        plot.save(tmp_path / "plot.png")
        assert (tmp_path / "plot.png").read_bytes()[:4] == b"\x89PNG"

    def test_csv_holds_every_number(self, plot: Plot) -> None:
        rows = plot.csv().splitlines()
        assert rows[0] == "series,x (mm),y (mm),more"
        assert sum(row.startswith("line,") for row in rows) == 50
        assert "dots,0,0,0.1" in rows

    def test_drawing_again_replaces(self, plot: Plot) -> None:
        count = len(plot.getPlotItem().items)
        for _ in range(5):
            plot.dots("dots", np.zeros(3), np.zeros(3), "#e69f00")
            plot.line("line", np.zeros(3), np.zeros(3), "#0072b2")
        assert len(plot.getPlotItem().items) <= count
        plot.clear_all()
        assert plot.drawn == {}


def test_void_calls_do_not_lose_references_to_none(qapp: QApplication) -> None:
    """Some versions of PySide6 lose one per call, and abort when none is left."""
    widget = QWidget()
    before = sys.getrefcount(None)
    for _ in range(100_000):
        widget.update()
    # Where None is immortal its count is a constant.
    assert sys.getrefcount(None) - before > -1000
    widget.deleteLater()


@pytest.mark.parametrize("name", list(THEMES))
def test_style_sheet_has_no_open_ends(name: str) -> None:
    assert "@" not in style_sheet(THEMES[name], 1.3)


class TestProtocolPage:
    @pytest.mark.parametrize("name", presets("protocols"))
    def test_text_reads_back(self, name: str, tmp_path: Path) -> None:
        protocol = load_protocol(name)
        path = tmp_path / "protocol.toml"
        path.write_text(to_toml(protocol), "utf-8")
        again = load_protocol(path)
        assert again.model_dump() == protocol.model_dump()

    def test_edits_and_undo(self, open_window: Callable[..., OperatorWindow]) -> None:
        window = open_window()
        page, space = window.pages["protocol"][1], window.space
        start = space.protocol
        page.table.selectRow(0)
        page._copy()
        assert len(space.protocol.runs) == len(start.runs) + 1
        page._move(1)
        page._remove()
        assert len(space.protocol.runs) == len(start.runs)
        page.table.selectRow(0)
        page.editor.speeds.setText("50; 500")
        page.editor.speeds.editingFinished.emit()
        assert space.protocol.runs[0].all_speeds_mm_s == (50.0, 500.0)
        page.form.taps.setValue(33)
        assert space.protocol.taps.count == 33
        while space.undo.canUndo():
            window.ask("undo")
        assert space.protocol == start
        window.ask("redo")
        assert len(space.protocol.runs) == len(start.runs) + 1

    def test_nonsense_is_refused_in_place(self, open_window: Callable[..., OperatorWindow]) -> None:
        window = open_window()
        page, before = window.pages["protocol"][1], window.space.protocol
        page.table.selectRow(0)
        page.editor.speeds.setText("fast")
        page.editor.speeds.editingFinished.emit()
        assert window.space.protocol == before
        assert page.editor.fault.text()

    def test_a_target_that_does_not_fit_is_reported(self, open_window: Callable[..., OperatorWindow]) -> None:
        window = open_window()
        page = window.pages["protocol"][1]
        page.table.selectRow(0)
        page.editor.radius.setValue(45)
        assert "leaves the screen" in page.preview.words.text()


class TestGeometryPage:
    def test_a_ruler_corrects_the_size(self, open_window: Callable[..., OperatorWindow]) -> None:
        window = open_window()
        page, space = window.pages["geometry"][1], window.space
        before = space.settings.panel.screen()
        page.measured.setValue(102.0)
        page._correct()
        after = space.settings.panel.screen()
        assert after.width_mm == pytest.approx(1.02 * before.width_mm, abs=0.06)
        assert after.height_mm == pytest.approx(1.02 * before.height_mm, abs=0.06)
        window.ask("undo")
        assert space.settings.panel.screen() == before

    def test_beam_and_stylus_are_kept(self, open_window: Callable[..., OperatorWindow]) -> None:
        window = open_window()
        page, space = window.pages["geometry"][1], window.space
        page.fields["stylus_mm"].setValue(6.5)
        page.fields["beam_slope"].setValue(0.01)
        page._numbers_edited()
        assert space.settings.panel.stylus().diameter_mm == 6.5
        assert space.settings.panel.beam().slope == pytest.approx(0.01)
        assert load_settings(window.space.settings_file)[0].panel == space.settings.panel


def test_help_shows_manual_and_keys(open_window: Callable[..., OperatorWindow]) -> None:
    page = open_window().pages["help"][1]
    assert "laser beam" in page.manual.toPlainText()
    for _, what in key_list({}):
        assert what in page.keys.toPlainText()


def test_a_legend_takes_the_colours_of_a_new_theme_and_an_empty_plot_has_none(open_window: Callable) -> None:
    window = open_window()
    plot = Plot("", "x (s)", "y (mm)", "test")
    plot.add_legend()
    assert not plot.legend.isVisible()
    plot.line("a", [0, 1], [0, 1], "#ff0000")
    before = theme().text
    window.ask("theme")
    plot.restyle()
    assert theme().text != before
    assert all(label.opts["color"] == theme().text for _, label in plot.legend.items)
    window.ask("theme")
    plot.close()
    plot.deleteLater()
