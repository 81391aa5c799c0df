"""The picture of a gap that shrinks, step by step."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import QPointF, QRect
from PySide6.QtGui import QColor, QFontMetricsF, QImage, QPainter
from PySide6.QtWidgets import QApplication

from draglag_app.windows.pages.parts.gap_steps import StepPlot
from draglag_app.windows.parts.theme import theme
from draglag_app.windows.wording.i18n import use_language


@pytest.mark.parametrize("language", ["en", "nl"])
@pytest.mark.parametrize(
    "effects", [["low_speed_plateau"], ["low_speed_plateau", "direction_asymmetry", "clock_drift"]]
)
def test_every_step_has_its_name_below_it(
    open_window: Callable, qapp: QApplication, language: str, effects: list[str]
) -> None:
    """On the smallest window, in the longest words."""
    window = open_window(language=language)
    window.resize(1280, 800)
    window.go("gap")
    steps = [
        {
            "effect": effect, "where": "", "parameters": {}, "gap_before_mm": 0.5, "gap_after_mm": 0.4,
            "evidence": {"p_value": 1e-9}, "probability": 0.9,
        }
        for effect in effects
    ]  # fmt: skip
    try:
        page = window.pages["gap"][1]
        page.show_report(
            {"verdict": "explained", "steps": steps, "gap_first_mm": 0.6, "gap_last_mm": 0.4, "noise_floor_mm": 0.1}
        )
        for _ in range(5):
            qapp.processEvents()
        assert len(names_drawn(page.plot)) == len(effects) + 2  # the first gap, the noise floor
    finally:
        use_language(qapp, "en")


def names_drawn(plot: StepPlot) -> list[str]:
    axis = plot.getPlotItem().getAxis("bottom")
    image = QImage(10, 10, QImage.Format.Format_RGB32)
    painter = QPainter(image)
    painter.setFont(axis.style["tickFont"] or painter.font())
    _, _, texts = axis.generateDrawSpecs(painter)
    painter.end()
    return [text for _, _, text in texts]


def test_the_waterfall_falls_from_the_first_gap_to_the_noise_floor(open_window: Callable, qapp: QApplication) -> None:
    window = open_window()
    window.resize(1280, 800)
    window.go("gap")
    page = window.pages["gap"][1]
    step = {"where": "", "parameters": {}, "evidence": {}}
    steps = [
        {**step, "effect": "clock_drift", "gap_before_mm": 0.6, "gap_after_mm": 0.3, "probability": 0.9},
        {**step, "effect": "beam_bow", "gap_before_mm": 0.3, "gap_after_mm": 0.25, "probability": 0.1},
    ]
    page.show_report(
        {
            "verdict": "unexplained", "steps": steps, "gap_first_mm": 0.6, "gap_last_mm": 0.25, "noise_floor_mm": 0.1,
            "unexplained_by": "speed", "not_seen": {"clock_offset": "taps timed on the same clock show it"},
            "provisional": {"covariate": "speed", "gap_before_mm": 0.25, "gap_after_mm": 0.12, "probability": 0.8},
        }
    )  # fmt: skip
    drawn = {name: [column.tolist() for column in columns] for name, columns in page.plot.drawn.items()}
    assert drawn["first gap"] == [[0.0], [0.0], [0.6]]
    assert drawn["steps"] == [[1.0], [0.3], [0.6]]
    # Less probable than not, and a term without a name: hatched, and marked by a sign as well.
    assert drawn["provisional"] == [[2.0, 3.0], [0.25, 0.12], [0.3, 0.25]]
    assert drawn["noise floor"] == [[4.0], [0.0], [0.1]]
    for _ in range(5):
        qapp.processEvents()
    names = names_drawn(page.plot)
    assert [name.startswith("~") for name in names] == [False, False, True, True, False]
    assert page.unseen_text.toPlainText() == "• clock offset: taps timed on the same clock show it"
    assert [round(shining_through(page.plot, *place), 1) > 0 for place in BARS] == [False, False, True, True, False]
    page.show_report({"verdict": "no_gap", "steps": [], "gap_first_mm": 0.1, "gap_last_mm": 0.1, "noise_floor_mm": 0.1})
    assert not page.unseen.isVisibleTo(page)


def test_a_gap_that_grows_is_labelled_by_what_is_left(open_window: Callable, qapp: QApplication) -> None:
    window = open_window()
    window.resize(1280, 800)
    window.go("gap")
    page = window.pages["gap"][1]
    step = {
        "effect": "smoothing_shrink", "where": "", "parameters": {}, "gap_before_mm": 0.16, "gap_after_mm": 0.17,
        "probability": 0.9, "evidence": {"text": "held-out runs are predicted better by 1171 nats"},
    }  # fmt: skip
    page.show_report(
        {"verdict": "explained", "steps": [step], "gap_first_mm": 0.16, "gap_last_mm": 0.17, "noise_floor_mm": 0.12}
    )
    for _ in range(5):
        qapp.processEvents()
    assert [name.split("\n")[-1] for name in names_drawn(page.plot)] == ["0.16 mm", "0.17 mm", "0.12 mm"]


def widths_and_places(plot: StepPlot) -> list[tuple[float, float]]:
    """How wide each name below the plot is, and its place."""
    axis = plot.getPlotItem().getAxis("bottom")
    letters = QFontMetricsF(axis.style["tickFont"])
    lines = [max(map(letters.horizontalAdvance, name.split("\n"))) for name in names_drawn(plot)]
    place = plot.getPlotItem().vb.width() / len(lines)
    return [(line, place) for line in lines]


@pytest.mark.parametrize("language", ["en", "nl"])
@pytest.mark.parametrize("size", [(960, 540), (853, 533), (1280, 800)])
def test_names_below_the_waterfall_do_not_run_into_each_other(
    open_window: Callable, qapp: QApplication, language: str, size: tuple[int, int]
) -> None:
    window = open_window(language=language)
    window.go("gap")
    step = {"where": "", "parameters": {}, "evidence": {}, "gap_before_mm": 0.5, "gap_after_mm": 0.3}
    steps = [
        {**step, "effect": effect, "probability": p} for effect, p in (("low_speed_plateau", 0.9), ("beam_bow", 0.1))
    ]
    report = {
        "verdict": "unexplained", "steps": steps, "gap_first_mm": 0.5, "gap_last_mm": 0.3, "noise_floor_mm": 0.1,
        "unexplained_by": "session_time",
        "provisional": {"covariate": "session_time", "gap_before_mm": 0.3, "gap_after_mm": 0.1, "probability": 0.8},
    }  # fmt: skip
    try:
        page = window.pages["gap"][1]
        page.show_report(report)
        window.resize(*size)  # afterwards: names follow the room
        for _ in range(5):
            qapp.processEvents()
        found = widths_and_places(page.plot)
        assert len(found) == 5
        assert [(wide, place) for wide, place in found if wide > place] == []
    finally:
        use_language(qapp, "en")


BARS = ((0, 0.0, 0.6), (1, 0.3, 0.6), (2, 0.25, 0.3), (3, 0.12, 0.25), (4, 0.0, 0.1))
"""Place, lower and upper end of each bar."""


def shining_through(plot: StepPlot, place: float, low: float, high: float) -> float:
    """Share of the plot's ground that is seen within a bar: none, or what a hatched area leaves."""
    drawn = plot.grab().toImage()
    box = plot.getPlotItem().vb
    ends = [plot.mapFromScene(box.mapViewToScene(QPointF(place + side, y))) for side, y in ((-0.28, high), (0.28, low))]
    inside = QRect(*ends).adjusted(2, 2, -2, -2)
    assert min(inside.width(), inside.height()) > 2
    ground = QColor(theme().panel).rgb()
    pixels = [
        drawn.pixel(x, y) for x in range(inside.left(), inside.right()) for y in range(inside.top(), inside.bottom())
    ]
    return pixels.count(ground) / len(pixels)
