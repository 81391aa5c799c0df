"""The page of the gap: what it shows of a report, effects by hand."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import pytest
from PySide6.QtWidgets import (
    QWidget,
)

from draglag.errors import DataError
from draglag_app.windows.parts.tasks import Progress
from draglag_app.windows.window import OperatorWindow


class TestGap:
    REPORT: ClassVar[dict[str, object]] = {
        "session": "s",
        "verdict": "explained",
        "noise_floor_mm": 0.15,
        "steps": [
            {
                "effect": "low_speed_plateau",
                "probability": 0.97,
                "indistinguishable_from": ["sample_hold"],
                "parameters": {"speed_mm_s": {"value": 118.0, "ci95": [112.0, 124.0]}},
                "where": "drag speed below 118 mm/s",
                "covariate": "speed",
                "evidence": {"p_value": 1e-9, "held_out_gain": 0.4},
                "gap_before_mm": 0.62,
                "gap_after_mm": 0.16,
            }
        ],
        "unexplained_by": None,
        "gap_first_mm": 0.62,
        "gap_last_mm": 0.16,
    }

    @pytest.fixture
    def page(self, opened: OperatorWindow) -> QWidget:
        if "gap" not in opened.pages:
            pytest.skip("this version cannot close the gap")
        return opened.pages["gap"][1]

    def test_report_is_shown_step_by_step(self, page: QWidget) -> None:
        page.show_report(self.REPORT)
        assert page.verdict.text() == (
            "Low-speed plateau or sample and hold 118 mm/s (112 to 124; probability 0.97) explains the gap: "
            "0.62 → 0.16 mm, noise 0.15."
        )
        row = [page.table.item(0, column).text() for column in range(5)]
        assert row[:2] == ["low-speed plateau or sample and hold", "0.97"]
        assert row[3] == "speed 118 mm/s (112 to 124)"
        assert page.table.chosen() == (-1, "")
        page.table.selectRow(0)
        assert page.table.chosen() == (0, "low_speed_plateau")  # files and commands call it by its id
        assert "Below a speed the latency no longer grows" in page.more.text()
        assert "(low_speed_plateau)" in page.more.text()
        assert row[4] == "0.620 → 0.160 mm"
        assert page.plot.drawn["gap"][1].tolist() == [0.62, 0.16]

    def test_what_is_beyond_chance_is_not_called_noise(self, page: QWidget) -> None:
        left = {"follows": "pitch_ripple", "probability": 0.9, "size_mm": 0.0312}
        none: dict[str, object] = {**self.REPORT, "verdict": "no_gap", "steps": []}
        page.show_report(none)
        assert page.verdict.text() == "No gap: 0.16 mm, noise 0.15. What is left is noise."
        page.show_report({**none, "tolerated": [left]})
        assert page.verdict.text().startswith("No gap worth a name: 0.16 mm, noise 0.15; what is left beyond chance")
        assert "Tolerated, too small to matter: electrode ripple, 0.03 mm" in page.more.text()
        page.show_report({**self.REPORT, "tolerated": [left]})
        assert "What is left beyond chance is too small to matter" in page.verdict.text()

    def test_other_explanations_and_the_curves_form_are_said(self, page: QWidget) -> None:
        sets = [(["low_speed_plateau"], 0.6), (["beam_bow", "low_speed_plateau"], 0.25), (["unexplained"], 0.12)]
        page.show_report(
            {
                **self.REPORT,
                "explanations": [{"effects": names, "probability": p} for names, p in sets],
                "law": {"adequate": False, "misses_ms": 1.21, "probability_other": 0.97},
            }
        )
        assert page.law.text().startswith("The curve is not Eq. 5: Eq. 5 misses it by 1.2 ms RMS (probability 0.97)")
        assert page.more.text().split("\n")[0] == (
            "Also possible: beam bow and low-speed plateau (probability 0.25), something without a name "
            "(probability 0.12)"
        )
        assert "0.60  low-speed plateau" in page.table.item(0, 1).toolTip()
        page.show_report(self.REPORT)
        assert page.law.text() == ""

    def test_a_verdict_without_effects_has_its_probability(self, page: QWidget) -> None:
        none: dict[str, object] = {**self.REPORT, "steps": [], "unexplained_by": "x"}
        page.show_report({**none, "verdict": "no_gap", "explanations": [{"effects": [], "probability": 0.95}]})
        assert page.verdict.text().startswith("No gap (probability 0.95): 0.16 mm")
        sets = [{"effects": ["unexplained"], "probability": 0.999}]
        page.show_report({**none, "verdict": "unexplained", "explanations": sets})
        assert page.verdict.text().startswith("Unexplained (probability 0.99): a gap remains that follows the place")

    def test_an_undo_while_the_gap_is_computed_shows_what_was_before(
        self, page: QWidget, opened: OperatorWindow, until: Callable, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fake(function: object, arguments: tuple, progress: Progress) -> dict[str, object]:
            _, without, added, *_ = arguments
            while added:  # until it is cancelled
                progress(0.0, "")
            return {**self.REPORT, "report": ("report", without)}

        monkeypatch.setattr("draglag_app.windows.pages.gap.run_in_subprocess", fake)
        page.explain_button.click()
        until(lambda: not opened.space.tasks.running)
        page.choice.setCurrentIndex(page.choice.findData("scan_skew"))
        page.add_button.click()
        assert opened.space.tasks.running
        chosen = page.choice.currentText()
        opened.ask("undo")
        assert opened.notice_text.text() == f"Undone: add effect {chosen}"
        until(lambda: not opened.space.tasks.running)
        assert page.table.rowCount() == 1
        assert "explains the gap" in page.verdict.text()
        assert page.add_button.isEnabled()

    def test_a_poor_session_says_what_is_missing(self, page: QWidget) -> None:
        poor = {"verdict": None, "steps": [], "missing": ["too few circles"], "noise_floor_mm": None}
        page.show_report({**self.REPORT, **poor, "gap_first_mm": None})
        assert page.verdict.text() == "too few circles"
        page.show_report({**self.REPORT, **poor, "missing": ["too few circles", "too few edges"], "gap_first_mm": None})
        assert page.verdict.text() == "too few circles; too few edges"
        assert page.plot.drawn == {}

    def test_an_effect_can_be_taken_out_and_brought_back(
        self, page: QWidget, opened: OperatorWindow, until: Callable, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked = []

        def fake(function: object, arguments: tuple, progress: Progress) -> dict[str, object]:
            asked.append(arguments[1])
            return self.REPORT

        monkeypatch.setattr("draglag_app.windows.pages.gap.run_in_subprocess", fake)
        page.explain_button.click()
        until(lambda: not opened.space.tasks.running)
        page.table.selectRow(0)
        page.remove_button.click()
        until(lambda: not opened.space.tasks.running)
        opened.ask("undo")
        assert opened.notice_text.text() == "Undone: remove effect low-speed plateau"
        until(lambda: not opened.space.tasks.running)
        assert asked == [frozenset(), frozenset({"low_speed_plateau"}), frozenset()]
        assert page.explain_button.isEnabled()

    def test_cancelling_brings_the_buttons_back(
        self, page: QWidget, opened: OperatorWindow, until: Callable, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def endless(function: object, arguments: tuple, progress: Progress) -> None:
            while True:
                progress(0.0, "")

        monkeypatch.setattr("draglag_app.windows.pages.gap.run_in_subprocess", endless)
        page.explain_button.click()
        assert not page.explain_button.isEnabled()
        opened.ask("cancel")
        until(lambda: not opened.space.tasks.running)
        assert page.explain_button.isEnabled()
        assert "Cancelled" in page.verdict.text()


class TestGapByHand:
    """Adding, comparing and saving, with the library's answer made up."""

    OVERLAY: ClassVar[dict[str, object]] = {
        "measured": {
            "residuals": {"speed": [[50, 500], [2.0, -1.0], [0.2, 0.1]]},
            "spread": [[-1, 0, 1], [20, 60, 20]],
        },
        "models": [
            {
                "name": name,
                "edges": [["run-01", 50.0, off, off - 1, off + 1]],
                "latencies": [["run-01", 50.0, 80.0, 0.3, 80.0 + off, 0.4]],
                "edge_rms_ms": off,
                "edge_rms_ms_ci95": [off - 0.1, off + 0.1],
                "runs_that_agree": [1, 1],
                "residuals": {"speed": [[50, 500], [0.0, 0.0], [0.1, 0.1]]},
                "spread": [[-1, 0, 1], [0, 100, 0]],
            }
            for name, off in (("", 5.0), ("low_speed_plateau", 0.2))
        ],
    }

    @pytest.fixture
    def page(self, opened: OperatorWindow, monkeypatch: pytest.MonkeyPatch) -> QWidget:
        page = opened.pages["gap"][1]
        self.asked: list[tuple] = []

        def fake(function: object, arguments: tuple, progress: Progress) -> dict[str, object]:
            _, without, added, kept, *_ = arguments
            self.asked.append((without, added, kept))
            step = TestGap.REPORT["steps"][0]  # type: ignore[index]
            extra = [{**step, "effect": effect, "evidence": {"p_value": 1.0, "text": "by hand"}} for effect in added]
            report = {**TestGap.REPORT, "steps": [step, *extra], "overlay": self.OVERLAY, "model": None}
            return {**report, "report": ("report", without, added)}

        monkeypatch.setattr("draglag_app.windows.pages.gap.run_in_subprocess", fake)
        return page

    def test_an_effect_is_added_taken_back_and_added_again(
        self, page: QWidget, opened: OperatorWindow, until: Callable
    ) -> None:
        def settle() -> None:
            until(lambda: not opened.space.tasks.running)

        page.explain_button.click()
        settle()
        page.choice.setCurrentIndex(page.choice.findData("scan_skew"))
        page.add_button.click()
        settle()
        first = ("report", frozenset(), ())
        assert self.asked == [(frozenset(), (), None), (frozenset(), ("scan_skew",), first)]
        assert page.table.item(1, 0).text().startswith("scan skew")
        assert "scan skew: by hand" in page.more.text()
        opened.ask("undo")
        settle()
        assert page.table.rowCount() == 1
        opened.ask("redo")
        settle()
        assert page.table.rowCount() == 2
        assert len(self.asked) == 2, "what was computed is kept"
        page.add_button.click()
        settle()
        assert "already" in page.verdict.text()

    def test_simulated_is_compared_with_measured_before_and_after(
        self, page: QWidget, opened: OperatorWindow, until: Callable
    ) -> None:
        page.explain_button.click()
        until(lambda: not opened.space.tasks.running)
        picture = page.picture
        drawn = picture.plot.drawn
        assert drawn["simulated, before"][1].tolist() == [5.0]
        assert drawn["simulated, after"][1].tolist() == [0.2]
        assert "5.00 ms (4.90 to 5.10)" in picture.words.text()
        picture.which.setCurrentIndex(picture.which.findData("after"))
        assert "simulated, before" not in picture.plot.drawn
        for k in range(picture.kind.count()):
            if picture.kind.itemData(k) in ("latencies", "speed", "spread"):
                picture.kind.setCurrentIndex(k)
                assert "measured" in picture.plot.drawn

    def test_a_fault_leaves_the_model_as_it_was(
        self, page: QWidget, opened: OperatorWindow, until: Callable, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        page.explain_button.click()
        until(lambda: not opened.space.tasks.running)

        def broken(function: object, arguments: tuple, progress: Progress) -> None:
            raise DataError("the model cannot be fitted with it", "Choose another effect")

        monkeypatch.setattr("draglag_app.windows.pages.gap.run_in_subprocess", broken)
        page.add_button.click()
        until(lambda: not opened.space.tasks.running)
        assert "cannot be fitted" in page.verdict.text()
        assert page.table.rowCount() == 1
        assert page.add_button.isEnabled()
