"""What holds on every page: what is always in sight, what every plot can do, what nothing does by itself."""

from __future__ import annotations

import ast
import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication, QDialog, QInputDialog, QMessageBox

import draglag_app.windows
from draglag_app.session import events
from draglag_app.windows.notice import NoticeStrip
from draglag_app.windows.parts.tasks import Progress, Tasks
from draglag_app.windows.parts.theme import THEMES, Theme
from draglag_app.windows.parts.widgets import Light
from draglag_app.windows.plots.plot import Plot
from draglag_app.windows.plots.plot_values import unit
from draglag_app.windows.window import OperatorWindow

SOURCE = Path(draglag_app.windows.__file__).parent
# Axes of plain counts and names.
_NO_UNIT = {"taps", "effects in the model"}


def plots(window: OperatorWindow) -> list[Plot]:
    window.pages.make_all()
    return window.findChildren(Plot)


class TestInSight:
    def test_lights_session_disk_and_clock_are_on_every_page(self, opened: OperatorWindow) -> None:
        header = opened.header
        for name in opened.pages:
            opened.go(name)
            QApplication.processEvents()
            for widget in (*header.lights.values(), header.session, header.disk, header.clock):
                corner = widget.mapTo(opened, QPoint(0, 0))
                assert widget.isVisible(), name
                assert opened.rect().contains(widget.rect().translated(corner)), name
        assert opened.space.session.name in header.session.text()
        assert "free" in header.disk.text()
        assert header.clock.text().count(":") == 2

    def test_lights_differ_in_shape_not_only_in_colour(self, qapp: QApplication) -> None:
        shapes = {}
        for state in ("off", "ready", "live", "warning", "fault"):
            light = Light()
            light.set_state(state)
            image = light.grab().toImage().convertToFormat(QImage.Format.Format_Grayscale8)
            data = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
            grey = data[:, : image.width()].astype(int)
            shapes[state] = np.abs(grey - grey[0, 0]) > 40
            light.deleteLater()
        for one, other in itertools.combinations(shapes, 2):
            assert (shapes[one] != shapes[other]).mean() > 0.05, (one, other)


# What is left of linear red, green and blue in eyes without one kind of cone (Viénot, Brettel & Mollon 1999).
_EYES = {
    "all cones": np.eye(3),
    "protanopia": np.array([[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]]),
    "deuteranopia": np.array([[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]]),
}
_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
_WHITE = np.array([0.9505, 1.0, 1.089])
# A difference of 2.3 is just seen side by side.
_PLAIN = 10.0


def seen(colour: str, eyes: np.ndarray) -> np.ndarray:
    """CIELAB of a colour as those eyes see it."""
    share = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    xyz = _XYZ @ np.clip(eyes @ linear, 0, 1) / _WHITE
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("eyes", _EYES)
@pytest.mark.parametrize("colours", THEMES.values(), ids=list(THEMES))
def test_colours_are_distinguished_by_the_colour_blind(colours: Theme, eyes: str) -> None:
    for group in (colours.series, (colours.ok, colours.warning, colours.bad)):
        for one, other in itertools.combinations(group, 2):
            apart = float(np.linalg.norm(seen(one, _EYES[eyes]) - seen(other, _EYES[eyes])))
            assert apart > _PLAIN, (one, other)


class TestEveryPlot:
    def test_axes_have_titles_with_units(self, opened: OperatorWindow) -> None:
        for plot in plots(opened):
            for side in ("bottom", "left"):
                title = plot.getPlotItem().getAxis(side).labelText
                assert title, plot.file_name
                assert unit(title) or title in _NO_UNIT, (plot.file_name, title)

    def test_what_is_drawn_is_reported_under_the_mouse_and_handed_out(
        self, opened: OperatorWindow, tmp_path: Path
    ) -> None:
        results = opened.pages["results"][1]
        opened.pages["compare"][1]._add_present()
        drawn = 0
        for name in ("results", "compare", "geometry", "protocol"):
            opened.go(name)
            for k in range(results.tabs.count() if name == "results" else 1):
                results.tabs.setCurrentIndex(k)
                QApplication.processEvents()
                for plot in plots(opened):
                    if not plot.isVisible() or not plot.drawn:
                        continue
                    drawn += 1
                    lines = plot.csv().splitlines()
                    named = {name.replace(",", ";") for name in plot.drawn}
                    assert {line.split(",")[0] for line in lines[1:]} == named, plot.file_name
                    self.hover(plot)
                    for suffix in ("png", "svg", "csv"):
                        path = tmp_path / f"{drawn}.{suffix}"
                        plot.save(path)
                        assert path.stat().st_size > 0
        assert drawn >= 6

    def hover(self, plot: Plot) -> None:
        series = next(iter(plot._hover.values()), None)
        if series is None:
            return
        where = np.flatnonzero(np.isfinite(series.x) & np.isfinite(series.y))
        x, y = float(series.x[where[0]]), float(series.y[where[0]])
        plot._hovered(plot.getPlotItem().vb.mapViewToScene(QPointF(x, y)))
        assert plot._tip.isVisible(), plot.file_name
        assert plot._tip.toPlainText(), plot.file_name

    def test_their_menus_copy(self, opened: OperatorWindow) -> None:
        opened.go("results")
        plot = opened.pages["results"][1].curve
        plot._menu(QPoint(5, 5))
        menu = QApplication.activePopupWidget()
        entries = {action.text(): action for action in menu.actions()}
        entries["Copy numbers"].trigger()
        assert QApplication.clipboard().text() == plot.csv()
        entries["Copy picture"].trigger()
        assert not QApplication.clipboard().pixmap().isNull()
        menu.close()


def test_nothing_stands_in_the_way_of_a_run(
    open_window: Callable, until: Callable, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Whatever happens in a run, nothing asks for an answer."""
    asked: list[str] = []
    for kind, names in (
        (QDialog, ("exec", "open")),
        (QMessageBox, ("exec", "question", "warning", "critical", "information", "about")),
        (QInputDialog, ("getText", "getItem")),
    ):
        for name in names:
            monkeypatch.setattr(kind, name, lambda *more, name=name, **named: asked.append(name))
    window = open_window()
    bridge, plot = window.space.bridge, window.record.live.trace
    gone = tmp_path / "gone" / "plot.png"
    monkeypatch.setattr("draglag_app.windows.parts.ask_files.pick_files", lambda *asked: asked[-1]([gone]))
    reported: list[str] = []

    def trouble(event: events.RunStarted) -> None:
        for source in ("touch", "laser", "file"):
            bridge.notice_raised.emit(events.NoticeRaised(0.0, "error", source, "something is wrong"))
        bridge.device_fault.emit(events.DeviceFault("walt", "serial:/dev/ttyACM0", "it was unplugged", "plug it in"))
        window.start()
        plot._save_as("png")
        reported.append(window.notice_text.text())

    bridge.run_started.connect(trouble)
    window.ask("start")
    until(lambda: window.space.session is not None and not window.space.tasks.running)
    assert asked == []
    assert reported
    assert all("cannot be written" in text for text in reported)


def test_work_that_takes_its_time_shows_how_far_it_is_and_can_be_cancelled(qapp: QApplication, until: Callable) -> None:
    tasks = Tasks(None)
    strip = NoticeStrip(tasks)
    going: list[float] = []

    def work(progress: Progress) -> None:
        while True:  # until it is cancelled
            progress(0.4, "")
            going.append(0.4)

    task = tasks.start("Working", work, lambda result: None, lambda text: None)
    until(lambda: strip.cancel.isVisibleTo(strip))
    until(lambda: strip.progress.value() == 400)
    assert strip.isVisible()
    strip.cancel.click()
    until(lambda: not tasks.running)
    assert task.cancelled
    assert not strip.cancel.isVisibleTo(strip)
    tasks.finish()
    strip.close()
    strip.deleteLater()


def calls(file: Path) -> list[tuple[str, ast.Call]]:
    found = []
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            found.append((name, node))
    return found


@pytest.mark.parametrize("file", sorted(SOURCE.rglob("*.py")), ids=lambda file: file.stem)
def test_what_is_shown_is_translated(file: Path) -> None:
    """No sentence goes to a widget as it stands in the source."""
    shows = {
        "setText", "setToolTip", "setPlaceholderText", "setWindowTitle", "setAccessibleName", "setTitle", "addAction",
        "button", "label", "Panel", "Fact", "notify", "show_text", "setSuffix", "setPrefix",
    }  # fmt: skip
    bare = []
    for name, call in calls(file):
        for argument in call.args if name in shows else ():
            parts = argument.values if isinstance(argument, ast.JoinedStr) else [argument]
            texts = [part.value for part in parts if isinstance(part, ast.Constant) and isinstance(part.value, str)]
            bare += [(call.lineno, text) for text in texts if " " in text.strip() and any(map(str.isalpha, text))]
    assert bare == []


@pytest.mark.parametrize("file", sorted((SOURCE / "pages").glob("*.py")), ids=lambda file: file.stem)
def test_pages_hold_no_mathematics(file: Path) -> None:
    """They show and ask; what is computed is computed in the library."""
    tree = ast.parse(file.read_text("utf-8"))
    imported = {
        alias.name.split(".")[0] for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names
    }
    imported |= {(node.module or "").split(".")[0] for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert not imported & {"scipy", "statistics"}
    drawing = {"array", "linspace", "cos", "sin", "pi", "asarray"}
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("np", "math")
    }
    assert used <= drawing, used - drawing
