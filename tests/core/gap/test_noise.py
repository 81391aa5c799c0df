"""What a fit says it does not know: the scatter of edges at every speed, and the interval of a plateau's speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from draglag.gap import close_gap
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.gap.fitting.noise import Components, scatter
from draglag.gap.traces.run_data import gather
from draglag.protocol.runs import load_protocol
from draglag.simulation import rig_for_screen, simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.low_speed_plateau.interval import plateau_ci95_mm_s

SESSIONS = 4


def fitted(screen: str, seed: int, *effects: str) -> Fit:
    demo = load_protocol("demo")
    runs = tuple(r.model_copy(update={"duration_s": 15.0}) for r in demo.runs if r.kind == "circle")
    protocol = demo.model_copy(update={"runs": runs, "taps": None})
    session = simulate_session(screen, protocol, effects=[parse_effect(e) for e in effects], seed=seed)
    return fit_session(session, gather(session), plateau=bool(effects))


def test_what_an_effect_leaves_unknown_is_not_reported_as_noise_of_the_touch_events() -> None:
    fit = fitted("screen-1", 0)
    unsure_mm = np.where(np.arange(fit.use.size) % 5 == 0, 3.0, 0.0)
    without, of_one_in_five = (
        scatter(fit.runs, fit.placed, fit.use, blur).rms_mm(Components()) for blur in (0 * unsure_mm, unsure_mm)
    )
    assert of_one_in_five["touch"] == pytest.approx(without["touch"])
    assert without["blur"] == 0
    assert of_one_in_five["blur"] == pytest.approx(3.0 / np.sqrt(5), rel=0.02)


@pytest.mark.parametrize("screen", ["screen-1", "screen-2"])
def test_edges_scatter_at_slow_drags_and_at_quick_ones_as_the_noise_says(screen: str) -> None:
    # A hand's tremor is as quick at slow drags, where the law is steep, as at fast ones, where it is flat.
    slow, fast = [], []
    for seed in range(SESSIONS):
        fit = fitted(screen, seed)
        white = fit.white.apply(fit.residual_mm)
        speed = fit.view.speed
        slow.append(white[speed < 120.0] ** 2)
        fast.append(white[speed > 400.0] ** 2)
    for squares in (np.concatenate(slow), np.concatenate(fast)):
        # Sizes are sought in steps of two: the variance of one may be off by two. Chance, ± 10 %, is far less.
        assert np.log(squares.mean()) == pytest.approx(0.0, abs=np.log(2.0))


def test_slow_touch_noise_is_found_as_such() -> None:
    """A window of positions averages fast noise; noise of 40 ms goes through it."""
    rig = replace(rig_for_screen("screen-1"), noise_slow_share=0.9, noise_slow_s=0.04)
    for seed in (1, 2, 3):
        report = close_gap(simulate_session(rig, load_protocol("demo"), seed=seed))
        assert report.verdict == "no_gap"
        levels = {part.name: part.level for part in report.noise}
        assert 0.05 <= levels["slow_mm"] <= 0.1  # of 0.14 mm in an event a window leaves a half to two thirds


def test_the_interval_of_a_plateaus_speed_holds_it() -> None:
    # No run lies between 135 and 180 mm/s, and none shows where in there the law begins to fall.
    held = 0
    for seed in range(10):
        low, high = plateau_ci95_mm_s(fitted("screen-1", seed, "low_speed_plateau=150"))
        assert high - low < 60.0  # but an interval that says nothing holds anything
        held += low <= 150.0 <= high
    assert held >= 8  # of ten at 95 %: less has a probability of 1 %
