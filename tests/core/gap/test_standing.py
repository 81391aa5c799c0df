"""A jump deadband is seen in positions that stand still, and neither it nor a smoothing filter is a loss of contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.sound_sessions import recorded, with_touch
from draglag.gap import close_gap
from draglag.gap.streams.evidence import inspect
from draglag.gap.streams.stamps import first_of_repeats
from draglag.protocol.runs import load_protocol
from draglag.recording import FloatArray, Session, TouchTrace
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect
from draglag.simulation.effects.base import TouchEvents


@pytest.fixture(scope="module")
def sound() -> Session:
    return recorded()


def at_rate(touch: TouchTrace, rate_hz: float, jitter: float = 0.03, speed: float = 1.0) -> TouchTrace:
    """The run at ``speed`` times its speed, by a panel whose frames jitter by a share of their interval."""
    t_s = np.arange(touch.t_s[0], touch.t_s[-1], 1 / rate_hz)
    t_s = t_s + jitter / rate_hz * np.random.default_rng(1).standard_normal(t_s.size).clip(-3, 3)
    own_s = touch.t_s[0] + speed * (t_s - touch.t_s[0])
    noise = np.random.default_rng(2).normal(0, 0.05, (2, t_s.size))
    x, y = (np.interp(own_s, touch.t_s, values) for values in (touch.x_mm, touch.y_mm))
    return TouchTrace(t_s, x + noise[0], y + noise[1], np.zeros(t_s.size, np.int64))


def after(touch: TouchTrace, text: str) -> TouchTrace:
    events = TouchEvents(touch.t_s, touch.x_mm, touch.y_mm, np.zeros(touch.t_s.size, np.int64))
    events = parse_effect(text).events(events, np.random.default_rng(7))
    return TouchTrace(events.t_s, events.x_mm, events.y_mm, events.contact_id)


def rounded(touch: TouchTrace, step_mm: float) -> TouchTrace:
    x, y = (step_mm * np.round(values / step_mm) if step_mm else values for values in (touch.x_mm, touch.y_mm))
    return replace(touch, x_mm=x, y_mm=y)


@pytest.mark.parametrize("width_mm", [0.3, 0.9])
@pytest.mark.parametrize(("step_mm", "jitter"), [(0.0, 0.003), (0.01, 0.03), (0.05, 0.03)])
def test_a_jump_deadband_is_named_with_its_width(
    sound: Session, width_mm: float, step_mm: float, jitter: float
) -> None:
    seen = with_touch(sound, lambda touch: rounded(after(at_rate(touch, 120, jitter), f"deadband={width_mm}"), step_mm))
    found, repaired = inspect(seen)
    assert [f.effect for f in found] == ["deadband"]
    assert found[0].parameters["kind"][0] == 0
    low, high = found[0].ci95
    assert low < width_mm < high
    assert high - low < 0.1 * width_mm + 1.5 * step_mm
    for run, raw in zip(repaired.runs, seen.runs, strict=True):
        assert np.all((np.diff(run.touch.x_mm) != 0) | (np.diff(run.touch.y_mm) != 0))
        kept = np.isin(raw.touch.t_s, run.touch.t_s)
        assert np.array_equal(raw.touch.x_mm[kept], run.touch.x_mm)
        assert kept.mean() > 0.2


@pytest.mark.parametrize("width_mm", [0.3, 0.9])
def test_frames_without_a_change_that_a_kernel_leaves_out_are_a_deadband_and_not_lost(
    sound: Session, width_mm: float
) -> None:
    def sent(touch: TouchTrace) -> TouchTrace:
        return first_of_repeats(after(at_rate(touch, 120), f"deadband={width_mm}"))

    found, _ = inspect(with_touch(sound, sent))
    assert [f.effect for f in found] == ["deadband"]
    low, high = found[0].ci95
    assert low < width_mm < high


def test_what_a_deadband_leaves_of_slow_runs_holds_no_fills(sound: Session) -> None:
    def slow(touch: TouchTrace) -> TouchTrace:
        return rounded(after(at_rate(touch, 120, speed=0.3), "deadband=0.3"), 0.01)

    assert [f.effect for f in inspect(with_touch(sound, slow))[0]] == ["deadband"]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("deadband=0.2,kind=1", []),
        ("deadband=0.4,kind=2", []),
        ("sample_hold=80", ["sample_hold"]),
        ("sample_hold=250", ["sample_hold"]),
    ],
)
def test_other_deadbands_and_loops_that_hold_jump_by_no_width(sound: Session, text: str, named: list[str]) -> None:
    found, _ = inspect(with_touch(sound, lambda touch: after(at_rate(touch, 120), text)))
    assert [f.effect for f in found] == named


@pytest.mark.parametrize("fuzz_mm", [0.4, 0.63, 0.9])
def test_what_a_fuzz_filter_holds_back_is_no_loop(sound: Session, fuzz_mm: float) -> None:
    def scanned(touch: TouchTrace) -> TouchTrace:
        """Four scans to a report: the filter's jumps are then of uneven age, in millimetres and not in time."""
        four = after(at_rate(touch, 240, 0.003), f"deadband={fuzz_mm},kind=2")
        one = TouchTrace(four.t_s[::4], four.x_mm[::4], four.y_mm[::4])
        return rounded(one, 0.08)

    assert "sample_hold" not in [f.effect for f in inspect(with_touch(sound, scanned))[0]]


def test_a_lost_contact_is_seen_behind_a_deadband(sound: Session) -> None:
    def both(touch: TouchTrace) -> TouchTrace:
        return after(after(at_rate(touch, 120), "deadband=0.3"), "loss_of_contact=20,duration_s=0.2")

    found = {f.effect: f for f in inspect(with_touch(sound, both))[0]}
    assert set(found) == {"deadband", "loss_of_contact"}
    assert found["loss_of_contact"].value == pytest.approx(20, rel=0.35)


@pytest.mark.parametrize(("loop_hz", "step_mm"), [(100, 0.1), (83, 0.25)])
def test_a_loop_that_holds_positions_in_whole_steps_loses_no_contact(
    sound: Session, loop_hz: int, step_mm: float
) -> None:
    """Held positions lie on a line as often as three whole ones do."""

    def held(touch: TouchTrace) -> TouchTrace:
        return after(rounded(at_rate(touch, 60, 5e-4), step_mm), f"sample_hold={loop_hz}")

    assert [item.effect for item in inspect(with_touch(sound, held))[0]] == ["sample_hold"]


def test_a_stylus_that_rests_behind_a_backlash_loses_no_contact(sound: Session) -> None:
    """Its positions stand still for many events: a line without a length, of whole steps."""

    def resting(touch: TouchTrace) -> TouchTrace:
        since_s = touch.t_s - touch.t_s[0]
        moving_s = touch.t_s[0] + 5.8 * (since_s // 6) + np.minimum(since_s % 6, 5.8)  # rests of 0.2 s
        x, y = (np.interp(moving_s, touch.t_s, values) for values in (touch.x_mm, touch.y_mm))
        return rounded(after(at_rate(replace(touch, x_mm=x, y_mm=y), 166), "deadband=0.35,kind=1"), 0.025)

    assert "loss_of_contact" not in [item.effect for item in inspect(with_touch(sound, resting))[0]]


@pytest.mark.parametrize("step_mm", [0.0, 0.01])
def test_an_average_over_longer_at_low_speeds_loses_no_contact(sound: Session, step_mm: float) -> None:
    def averaged(touch: TouchTrace) -> TouchTrace:
        fast = at_rate(touch, 240)
        t_s, xy = fast.t_s, np.column_stack([fast.x_mm, fast.y_mm])
        before = np.searchsorted(t_s, t_s - 0.05)
        speed: FloatArray = np.hypot(*(xy - xy[before]).T) / np.maximum(t_s - t_s[before], 1e-3)
        window_s = np.select([speed < 150, speed < 400], [0.16, 0.08], 0.03)
        begin, end = np.searchsorted(t_s, t_s - window_s, side="right"), np.arange(t_s.size) + 1
        total = np.vstack([np.zeros(2), np.cumsum(xy, axis=0)])
        x, y = ((total[end] - total[begin]) / (end - begin)[:, None]).T
        return rounded(TouchTrace(t_s, x, y, fast.contact_id), step_mm)

    assert inspect(with_touch(sound, averaged))[0] == ()


@pytest.mark.filterwarnings("error")
def test_stamps_that_are_mostly_alike_are_neither_lost_nor_a_fault(sound: Session) -> None:
    # 240 frames a second on a clock of 16 ms: three of four intervals are none.
    def coarse(touch: TouchTrace) -> TouchTrace:
        fast = at_rate(touch, 240.0)
        return replace(fast, t_s=0.016 * np.floor(fast.t_s / 0.016))

    seen, _ = inspect(with_touch(sound, coarse))
    assert "loss_of_contact" not in [item.effect for item in seen]


def test_a_wide_deadband_explains_the_positions_that_stand_still() -> None:
    """Its removal leaves half of the events of a slow run: simulated again it reports as often as the panel did."""
    session = simulate_session("screen-1", load_protocol("demo"), effects=[parse_effect("deadband=0.7")], seed=5)
    report = close_gap(session)
    assert (report.verdict, [step.effect for step in report.steps]) == ("explained", ["deadband"])
    (repeats,) = [one for one in report.check if one.name == "repeated positions"]
    assert repeats.simulated == pytest.approx(repeats.measured, abs=0.05)
