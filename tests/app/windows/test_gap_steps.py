"""The picture of a gap that shrinks, step by step."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtGui import QImage, QPainter
from PySide6.QtWidgets import QApplication

from draglag_app.windows.pages.parts.gap_steps import StepPlot
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
    page.show_report({"verdict": "no_gap", "steps": [], "gap_first_mm": 0.1, "gap_last_mm": 0.1, "noise_floor_mm": 0.1})
    assert not page.unseen.isVisibleTo(page)
