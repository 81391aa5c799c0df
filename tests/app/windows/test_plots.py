"""What a plot says: true axes, values under the mouse, files that are there or a sentence why not."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPointF
from PySide6.QtGui import QImage, QPainter
from PySide6.QtWidgets import QApplication, QMessageBox

from draglag.errors import DataError
from draglag_app.windows.parts.theme import apply_theme, theme
from draglag_app.windows.plots.plot import Plot
from draglag_app.windows.plots.plot_values import unit
from draglag_app.windows.window import OperatorWindow


@pytest.fixture
def plot(qapp: QApplication) -> Iterator[Plot]:
    made = Plot("", "drag speed (mm/s)", "gap (mm RMS)", "test")
    made.resize(400, 300)
    made.show()
    yield made
    made.close()
    made.deleteLater()


def hover(plot: Plot, x: float, y: float) -> str:
    """What is said with the mouse at that place, in the plot's units."""
    QApplication.processEvents()
    plot._hovered(plot.getPlotItem().vb.mapViewToScene(QPointF(x, y)))
    return plot._tip.toPlainText() if plot._tip.isVisible() else ""


def test_numbers_below_one_are_not_shown_a_thousandfold_after_a_change_of_theme(plot: Plot) -> None:
    plot.line("gap", np.arange(3.0), np.full(3, 0.15), "#ffffff")
    plot.setYRange(0, 0.2, padding=0)
    QApplication.processEvents()
    plot.restyle()
    axis = plot.getPlotItem().getAxis("left")
    assert axis.tickStrings([0.1, 0.2], axis.autoSIPrefixScale * axis.scale, 0.1) == ["0.1", "0.2"]


@pytest.mark.parametrize("name", ["dark", "light"])
def test_a_band_is_seen_between_its_curves_in_both_themes(plot: Plot, qapp: QApplication, name: str) -> None:
    apply_theme(qapp, name)
    try:
        plot.restyle()
        plot.band("curve 95 %", np.array([0.0, 10.0]), np.array([0.2, 0.2]), np.array([0.8, 0.8]), theme().blue)
        plot.setXRange(0, 10, padding=0)
        plot.setYRange(0, 1, padding=0)
        QApplication.processEvents()
        picture, box = plot.grab().toImage(), plot.getPlotItem().vb

        def colour(y: float) -> np.ndarray:
            """The middle of what is there at that height; single pixels may be of the grid."""
            places = [box.mapViewToScene(QPointF(x, y)).toPoint() for x in np.linspace(1.1, 8.9, 40)]
            return np.median([picture.pixelColor(place).getRgb()[:3] for place in places], axis=0)

        assert np.abs(colour(0.53) - colour(0.93)).max() > 30
        assert np.abs(colour(0.07) - colour(0.93)).max() < 5
    finally:
        apply_theme(qapp, "dark")


@pytest.mark.parametrize("name", ["dark", "light"])
def test_the_grid_lies_under_a_curve_and_is_seen_on_the_ground(plot: Plot, qapp: QApplication, name: str) -> None:
    apply_theme(qapp, name)
    try:
        plot.restyle()
        plot.line("curve", np.array([0.0, 10.0]), np.array([0.45, 0.45]), "#ff8800", width=5)
        plot.setXRange(0, 10, padding=0)
        plot.setYRange(0, 1, padding=0)
        QApplication.processEvents()
        picture, box = plot.grab().toImage(), plot.getPlotItem().vb

        def colours(y: float) -> set[str]:
            """What is there from end to end at that height."""
            ends = [box.mapViewToScene(QPointF(x, y)).toPoint() for x in (0.5, 9.5)]
            return {picture.pixelColor(x, ends[0].y()).name() for x in range(ends[0].x(), ends[1].x())}

        assert colours(0.45) == {"#ff8800"}
        assert len(colours(0.77)) >= 2
    finally:
        apply_theme(qapp, "dark")


def test_names_above_a_narrow_plot_stay_legible(plot: Plot) -> None:
    plot.resize(260, 300)
    plot.name_above("run-01", [("x", "#fff", name) for name in ("not corrected", "top, shifted", "bottom, shifted")])
    QApplication.processEvents()
    title = plot.getPlotItem().titleLabel
    assert title.item.sceneBoundingRect().width() <= plot.width()
    assert float(title.opts["size"].removesuffix("pt")) >= 7.5
    assert "bottom, shifted" in title.item.toPlainText()


def test_residuals_show_the_band_as_wide_as_the_runs(opened: OperatorWindow) -> None:
    opened.go("results")
    page = opened.pages["results"][1]
    low, high = page.curve.drawn["curve 95 %"][1:]
    page.show_residuals.click()
    drawn, analysis = page.curve.drawn, opened.space.analysis
    np.testing.assert_allclose(drawn["curve 95 %"][2] - drawn["curve 95 %"][1], high - low, atol=1e-9)
    np.testing.assert_allclose(drawn["curve"][1], 0.0, atol=1e-9)
    run = next(one for one in analysis.runs if not one.flags and one.latency_s is not None)
    left_ms = 1e3 * (run.latency_s - float(analysis.curve.predict_s(np.array([run.speed_mm_s]))[0]))
    assert np.abs(drawn["runs"][1] - left_ms).min() < 1e-9
    low_ms, high_ms = page.curve.getPlotItem().vb.viewRange()[1]
    assert high_ms - low_ms < 10 * np.nanmax(drawn["runs"][2] + np.abs(drawn["runs"][1]))
    page.show_residuals.click()
    assert page.curve.drawn["curve"][1].min() > 5  # latencies again


def test_points_and_lines_tell_their_values_and_empty_places_nothing(plot: Plot) -> None:
    plot.line("curve", np.array([0.0, 100.0]), np.array([0.0, 1.0]), "#ffffff")
    plot.dots("runs", np.array([80.0]), np.array([0.2]), "#ffffff", words=["run-07\n0.20 mm"])
    plot.dots("more", np.array([10.0]), np.array([0.9]), "#ffffff")
    plot.line("broken", np.array([0.0, np.nan, 5.0]), np.array([0.5, np.nan, np.nan]), "#ffffff")
    assert hover(plot, 50, 0.5) == "curve\n50 mm/s\n0.5 mm RMS"  # between its two points
    assert hover(plot, 80, 0.2) == "run-07\n0.20 mm"
    assert hover(plot, 10, 0.9) == "more\n10 mm/s\n0.9 mm RMS"
    assert hover(plot, 30, 0.95) == ""


def test_a_point_on_a_line_speaks_before_it(plot: Plot) -> None:
    plot.line("curve", np.array([0.0, 100.0]), np.array([0.0, 1.0]), "#ffffff")
    plot.dots("runs", np.array([50.0]), np.array([0.5]), "#ffffff", words=["run-01"])
    assert hover(plot, 50.2, 0.502) == "run-01"


@pytest.mark.parametrize(("title", "said"), [("x (mm)", "mm"), ("95 % interval (± ms)", "ms"), ("taps", "")])
def test_units_are_those_of_the_axis(title: str, said: str) -> None:
    assert unit(title) == said


@pytest.mark.parametrize("suffix", ["png", "svg", "csv"])
def test_what_is_saved_is_there_also_without_an_ending(
    plot: Plot, suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plot.line("curve", np.array([0.0, 1.0]), np.array([2.0, 3.0]), "#ffffff")
    monkeypatch.setattr("draglag_app.windows.parts.ask_files.pick_files", lambda *asked: asked[-1]([tmp_path / "mine"]))
    plot._save_as(suffix)
    (made,) = tmp_path.iterdir()
    assert made.name == f"mine.{suffix}"
    if suffix == "png":
        assert QImage(str(made)).width() >= 1600
    else:
        assert ("<svg" if suffix == "svg" else "curve,1,3") in made.read_text("utf-8")


@pytest.mark.parametrize("suffix", ["png", "svg", "csv"])
def test_what_cannot_be_saved_is_reported(
    plot: Plot, suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plot.line("curve", np.array([0.0, 1.0]), np.array([2.0, 3.0]), "#ffffff")
    path = tmp_path / "gone" / f"plot.{suffix}"
    with pytest.raises(DataError, match="cannot be written"):
        plot.save(path)
    reported: list[str] = []
    monkeypatch.setattr("draglag_app.windows.parts.ask_files.pick_files", lambda *asked: asked[-1]([path]))
    monkeypatch.setattr(QMessageBox, "warning", lambda parent, title, text: reported.append(text))
    plot._save_as(suffix)
    assert os.fspath(path) in reported[0]


def test_the_gap_plot_shows_gap_and_noise_floor(open_window: Callable) -> None:
    page = open_window().pages["gap"][1]
    page.show_report(
        {"verdict": "no_gap", "steps": [], "gap_first_mm": 0.15, "gap_last_mm": 0.15, "noise_floor_mm": 0.57}
    )
    (_, (low, high)) = page.plot.getPlotItem().vb.viewRange()
    assert low <= 0.0 < 0.15 < 0.57 < high


def test_a_long_title_takes_no_room_from_the_plot(plot: Plot) -> None:
    plot.line("curve", np.array([0.0, 100.0]), np.array([0.0, 1.0]), "#ffffff")
    QApplication.processEvents()
    for lines in (["run-01 · 555 mm/s · 38.7 ± 0.1 ms, of a session with a long name"], ["short", "x" * 60]):
        plot.title_lines(lines)
        QApplication.processEvents()
        assert plot.getPlotItem().vb.sceneBoundingRect().right() <= plot.width(), lines


def test_a_title_follows_the_width_of_its_plot(plot: Plot, until: Callable) -> None:
    plot.line("curve", np.array([0.0, 100.0]), np.array([0.0, 1.0]), "#ffffff")
    title, item = plot.getPlotItem().titleLabel, plot.getPlotItem()
    for lines in (["run-01 · 555 mm/s · 38.7 ± 0.1 ms, of a session with a long name"], ["short", "x" * 60]):
        plot.resize(900, 300)
        QApplication.processEvents()
        plot.title_lines(lines)
        QApplication.processEvents()
        wide_px = title.item.boundingRect().width()
        plot.resize(320, 300)
        until(lambda: title.item.boundingRect().width() <= plot.width())
        assert title.item.sceneBoundingRect().right() <= plot.width()
        assert item.vb.sceneBoundingRect().right() <= plot.width()
        plot.resize(900, 300)
        until(lambda wide_px=wide_px: title.item.boundingRect().width() == pytest.approx(wide_px))


def test_a_picture_that_leaves_the_program_says_what_it_is_from(
    opened: OperatorWindow, tmp_path: Path, qapp: QApplication
) -> None:
    plot = opened.pages["results"][1].findChild(Plot)
    line = opened.figure_source()
    assert line.startswith("SIMULATED · ")
    plot.save(tmp_path / "drawing.svg")
    assert line in (tmp_path / "drawing.svg").read_text("utf-8")
    plot.save(tmp_path / "picture.png")
    picture = QImage(str(tmp_path / "picture.png"))
    foot = picture.copy(0, picture.height() - 20, picture.width(), 20)
    colours = {foot.pixel(x, y) for x in range(foot.width()) for y in range(foot.height())}
    assert len(colours) > 1  # an empty strip has one


@pytest.mark.parametrize("height", [110, 130, 300])
@pytest.mark.parametrize("most", [0.2, 760.0])
def test_numbers_of_a_low_plot_do_not_stand_on_each_other(
    plot: Plot, qapp: QApplication, height: int, most: float
) -> None:
    plot.setMinimumHeight(height)
    plot.title_lines(["Speed"])
    plot.resize(300, height)
    plot.line("speed", np.arange(3.0), np.array([0.0, most, most]), "#ffffff")
    for _ in range(3):
        qapp.processEvents()
    axis = plot.getPlotItem().getAxis("left")
    image = QImage(10, 10, QImage.Format.Format_RGB32)
    painter = QPainter(image)
    painter.setFont(axis.style["tickFont"])
    _, _, numbers = axis.generateDrawSpecs(painter)
    high = painter.fontMetrics().ascent()  # digits have nothing below their line
    painter.end()
    middles = sorted(place.center().y() for place, _, _ in numbers)
    assert len(middles) >= 1
    assert all(lower - upper >= high for upper, lower in pairwise(middles))
