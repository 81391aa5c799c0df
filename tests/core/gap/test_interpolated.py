"""Reports that are interpolated between slower scans, and straight stretches that are no filled loss of contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from core.sound_sessions import demo, recorded, with_touch
from draglag.gap import close_gap
from draglag.gap.streams.evidence import inspect
from draglag.gap.streams.interpolated import is_interpolated, reports_a_scan
from draglag.protocol.runs import load_protocol
from draglag.recording import Session, TouchTrace
from draglag.simulation import simulate_session
from draglag.simulation.rig import rig_for_screen

FILLED_OR_HELD = ("loss_of_contact", "sample_hold")


def scanned_each(n: int) -> Callable[[TouchTrace], TouchTrace]:
    """Every n-th report is a scan, the others are on the chord to the next one, which is waited for."""

    def interpolated(touch: TouchTrace) -> TouchTrace:
        every = np.arange(touch.t_s.size)
        x_mm, y_mm = (np.interp(every, every[::n], values[::n]) for values in (touch.x_mm, touch.y_mm))
        return replace(touch, t_s=touch.t_s + (n - 1) * np.median(np.diff(touch.t_s)), x_mm=x_mm, y_mm=y_mm)

    return interpolated


@pytest.mark.parametrize("n", [2, 3, 4, 7])
def test_reports_between_scans_are_counted_and_are_neither_filled_nor_held(n: int) -> None:
    for sound in (recorded(), demo()):
        session = with_touch(sound, scanned_each(n))
        assert reports_a_scan([run.touch for run in session.runs]) == n
        assert [one.effect for one in inspect(session)[0] if one.effect in FILLED_OR_HELD] == []
        assert reports_a_scan([run.touch for run in sound.runs]) == 1


def test_chords_between_slow_scans_have_no_name() -> None:
    """At 120 reports and 30 scans a second circles of 50 mm radius are 0.1 mm small at 300 mm/s, 0.4 at 600."""
    report = close_gap(with_touch(demo(), scanned_each(4)))
    assert (report.verdict, report.unexplained_by) == ("unexplained", "frame")
    assert all(step.probability <= 0.5 for step in report.steps)


def test_chords_between_fast_scans_move_nothing() -> None:
    """At 1000 reports and 250 scans a second it is 0.006 mm at 600 mm/s."""
    fast = replace(rig_for_screen("screen-1"), touch_rate_hz=1000.0, resolution_mm=0.0)
    protocol = load_protocol("demo")
    circles = tuple(run.model_copy(update={"duration_s": 8.0}) for run in protocol.runs if run.kind == "circle")
    session = simulate_session(fast, protocol.model_copy(update={"runs": circles, "taps": None}), seed=5)
    session = with_touch(session, scanned_each(4))
    assert reports_a_scan([run.touch for run in session.runs]) == 4
    assert not is_interpolated(session)


def resting_at_first(touch: TouchTrace) -> TouchTrace:
    """Half a second at 3 mm/s before the drag, as a filter shows a stylus that rests: smooth to 0.05 µm."""
    before = np.arange(60)
    quiet_mm = 0.025 * before + np.random.default_rng(0).normal(0, 5e-5, before.size)
    dt_s = float(np.median(np.diff(touch.t_s)))
    ids = np.append(np.full(before.size, touch.contact_id[0]), touch.contact_id) if touch.contact_id.size else None
    return replace(
        touch,
        t_s=np.append(touch.t_s[0] - dt_s * (before.size - before), touch.t_s),
        x_mm=np.append(touch.x_mm[0] - quiet_mm[::-1], touch.x_mm),
        y_mm=np.append(np.full(before.size, touch.y_mm[0]), touch.y_mm),
        contact_id=touch.contact_id if ids is None else ids,
    )


def test_a_stylus_that_rests_smoothly_is_no_filled_loss() -> None:
    assert [one.effect for one in inspect(with_touch(recorded(), resting_at_first))[0]] == []


def lost(per_min: float, duration_s: float) -> Callable[[TouchTrace], TouchTrace]:
    """Losses at random, each filled with a line."""

    def filled(touch: TouchTrace) -> TouchTrace:
        t_s, rng = touch.t_s, np.random.default_rng(touch.t_s.size)
        away = np.zeros(t_s.size, bool)
        for start_s in rng.uniform(t_s[0], t_s[-1], rng.poisson(per_min * np.ptp(t_s) / 60)):
            away |= (t_s > start_s) & (t_s < start_s + duration_s)
        away[[0, -1]] = False
        x_mm, y_mm = (np.interp(t_s, t_s[~away], values[~away]) for values in (touch.x_mm, touch.y_mm))
        return replace(touch, x_mm=x_mm, y_mm=y_mm)

    return filled


def test_more_losses_than_a_panel_has_are_something_else() -> None:
    """The library's effect has at most 120 a minute; streams of something else are left as they are."""

    def losses(session: Session) -> list[float]:
        return [one.value for one in inspect(session)[0] if one.effect == "loss_of_contact"]

    fine = with_touch(recorded(), lost(30.0, 0.06))
    (per_min,) = losses(fine)
    assert per_min == pytest.approx(30.0, rel=0.3)
    many = with_touch(recorded(), lost(300.0, 0.06))
    assert losses(many) == []
    for run, repaired in zip(many.runs, inspect(many)[1].runs, strict=True):
        assert run.touch.t_s.size == repaired.touch.t_s.size
    (found,) = [one for one in inspect(fine)[0] if one.effect == "loss_of_contact"]
    duration_s, (low_s, high_s) = found.parameters["duration_s"]
    assert low_s <= duration_s <= high_s
    assert duration_s == pytest.approx(0.06, abs=0.02)  # two intervals of 10 ms reach beyond the loss
