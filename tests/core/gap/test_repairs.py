"""What streams show has to predict held-out runs, as every other member of an explanation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.sound_sessions import demo, with_touch
from draglag.gap import close_gap, workflow
from draglag.gap.streams.stamps import StreamEffect
from draglag.recording import Session, TouchTrace


@pytest.mark.parametrize(("wrong_mm", "verdict"), [(0.0, "explained"), (0.8, "unexplained")])
def test_a_repair_that_moves_held_out_runs_off_the_model_explains_nothing(
    monkeypatch: pytest.MonkeyPatch, wrong_mm: float, verdict: str
) -> None:
    """A repair that shifts the events of every second second by 0.8 mm makes the gap three times as large."""

    def shifted(touch: TouchTrace) -> TouchTrace:
        return replace(touch, y_mm=touch.y_mm + wrong_mm * (np.floor(touch.t_s) % 2))

    shown = StreamEffect("loss_of_contact", "losses_per_min", 6.0, (4.0, 8.0), "the trace", "made", 1.0)

    def inspect(session: Session) -> tuple[tuple[StreamEffect, ...], Session]:
        return (shown,), with_touch(session, shifted)

    monkeypatch.setattr(workflow, "inspect", inspect)
    report = close_gap(demo())
    step = report.steps[0]
    assert step.effect == "loss_of_contact"
    assert (step.gap_after_mm > 2 * step.gap_before_mm) is (wrong_mm > 0)
    assert report.verdict == verdict
    assert (step.probability > 0.5) is (verdict == "explained")
