"""Filters through the events: what they do by closed forms, and that a trace is freed of them again."""

from types import SimpleNamespace

import numpy as np
import pytest

from draglag.recording import FloatArray
from draglag.simulation.effects import EFFECTS, parse_effect
from draglag.simulation.effects.base import TouchEvents
from draglag.simulation.effects.prediction.undone import Behind

RATE_HZ = 120.0
SPEED = 180.0
FILTERS = ("prediction", "speed_adaptive_filter", "deadband")


def _events(t_s: FloatArray, xy_mm: FloatArray, contact: int = 1) -> TouchEvents:
    return TouchEvents(t_s, xy_mm[:, 0], xy_mm[:, 1], np.full(t_s.size, contact, np.int64))


def _after(text: str, t_s: FloatArray, xy_mm: FloatArray) -> FloatArray:
    out = parse_effect(text).events(_events(t_s, xy_mm), np.random.default_rng(0))
    assert np.array_equal(out.t_s, t_s)
    return np.column_stack([out.x_mm, out.y_mm])


def _times(duration_s: float) -> FloatArray:
    return np.arange(int(duration_s * RATE_HZ)) / RATE_HZ


def _line(duration_s: float = 12.0, speed: float = SPEED) -> tuple[FloatArray, FloatArray]:
    t = _times(duration_s)
    return t, np.column_stack([0.6 * speed * t, 0.8 * speed * t])


def _circle(omega: float, radius_mm: float = 40.0, duration_s: float = 20.0) -> tuple[FloatArray, FloatArray]:
    t = _times(duration_s)
    return t, radius_mm * np.column_stack([np.cos(omega * t), np.sin(omega * t)])


def _drag(duration_s: float = 20.0) -> tuple[FloatArray, FloatArray]:
    """A noisy drag whose speed goes from 20 to 400 mm/s and back."""
    t = _times(duration_s)
    angle = 5 * t + 4.6 * np.sin(t)
    noise = np.random.default_rng(3).normal(0, 0.05, (t.size, 2))
    return t, 40 * np.column_stack([np.cos(angle), np.sin(angle)]) + noise


def test_prediction_is_ahead_by_its_horizon_on_a_line() -> None:
    t, xy = _line()
    ahead = np.hypot(*(_after("prediction=0.015", t, xy) - xy).T)
    assert ahead[5:] == pytest.approx(0.015 * SPEED)
    assert ahead[0] == 0


def test_prediction_on_a_circle_is_as_its_columns_say() -> None:
    # The columns: earlier by h, and off by -(h d + h²/2) of the acceleration, d half the window. The first order of
    # the closed form |1 + h / w (1 - exp(-i omega w))|; the path between two events is a chord.
    omega, h, w = 4.0, 0.015, 0.02
    t, xy = _circle(omega)
    shown = _after(f"prediction={h},window_s={w}", t, xy)
    radius = np.hypot(*shown[10:].T) / 40
    assert radius == pytest.approx(abs(1 + h / w * (1 - np.exp(-1j * omega * w))), abs=1e-4)
    assert radius == pytest.approx(1 + (h * w / 2 + h**2 / 2) * omega**2, abs=2e-4)
    lead = np.unwrap(np.arctan2(shown[:, 1], shown[:, 0]))[10:] - omega * t[10:]
    assert lead / omega == pytest.approx(h, rel=0.01)


def test_columns_move_edges_as_the_effects_do() -> None:
    n = np.ones(5)
    view = SimpleNamespace(
        speed=45.0 * n,
        a_across=640.0 * n,
        turn_rad_s=4.0 * n,
        law_slope=-1e-4 * n,
        panel_x=np.linspace(-1, 1, 5),
        since_start_s=np.linspace(0, 750, 5),
    )
    (ahead,) = EFFECTS["prediction"].columns_at((0.015, 0.02), view)  # type: ignore[attr-defined]
    # A circle that is shown larger is shown faster than the stylus is, whose latency is that of a lower speed.
    faster = 45.0 * (0.015 * 0.01 + 0.015**2 / 2) * 4.0**2
    assert 0.015 * ahead.latency == pytest.approx(1e-4 * faster)
    assert 0.015 * ahead.offset == pytest.approx(-(0.015 * 0.01 + 0.015**2 / 2) * 640)
    bowed = EFFECTS["beam_bow"].signatures(view)[0]  # type: ignore[arg-type]
    assert bowed.offset[:, 0] == pytest.approx([0, 0.75, 1, 0.75, 0])
    for fading in EFFECTS["warm_up"].signatures(view):  # type: ignore[arg-type]
        assert fading.latency[:, 0] == pytest.approx(np.exp(-view.since_start_s / fading.theta[0]))
    assert all(s.theta[0] <= 750.0 for s in EFFECTS["warm_up"].signatures(view))  # type: ignore[arg-type]


@pytest.mark.parametrize(("horizon_s", "window_s"), [(0.015, 0.02), (0.03, 0.005), (0.04, 0.1)])
def test_undoing_a_prediction_brings_path_and_noise_back(horizon_s: float, window_s: float) -> None:
    rng = np.random.default_rng(3)
    t, xy = _circle(4.0)
    raw = xy + rng.normal(0, 0.1, xy.shape)
    contact = np.where(t > 0.6 * t[-1], 1, 0)
    t = t + 0.5 * contact  # the stylus was lifted
    shown = parse_effect(f"prediction={horizon_s},window_s={window_s}").events(TouchEvents(t, *raw.T, contact), rng)
    behind = Behind.of(t, horizon_s, window_s)
    reported = np.column_stack([shown.x_mm, shown.y_mm])
    assert behind.before(reported) == pytest.approx(raw, abs=1e-9)
    # By the weights, small ones left out, noise comes back to a few percent of its size.
    noise = rng.normal(0, 0.1, reported.shape)
    off = behind.weights() @ noise - behind.before(noise)
    assert np.std(off) < 0.05 * np.std(behind.before(noise))


def test_every_contact_is_predicted_by_itself() -> None:
    t, xy = _line(1.0)
    events = _events(t, xy)
    two = TouchEvents(t, events.x_mm, events.y_mm, (t > 0.5).astype(np.int64))
    out = parse_effect("prediction=0.02").events(two, np.random.default_rng(0))
    first = int(np.flatnonzero(t > 0.5)[0])
    assert out.x_mm[first] == events.x_mm[first]
    assert out.x_mm[first - 1] > events.x_mm[first - 1] + 1


def test_one_euro_lags_by_the_delay_of_its_cut_off() -> None:
    t, xy = _line()
    behind = np.hypot(*(xy - _after("speed_adaptive_filter=1,beta_per_mm=0.02", t, xy))[-200:].T)
    delay_s = 1 / (2 * np.pi * (1 + 0.02 * SPEED))  # of the discrete filter: the steps let through turn / (1 + turn)
    assert behind / SPEED == pytest.approx(delay_s, rel=1e-3)
    in_a_curve_s = EFFECTS["speed_adaptive_filter"].curve_extra_s(
        np.array([SPEED]), {"fmin_hz": 1.0, "beta_per_mm": 0.02}
    )
    assert in_a_curve_s == pytest.approx([delay_s])


def test_one_euro_smooths_more_at_rest() -> None:
    rng = np.random.default_rng(4)
    t = _times(60.0)
    noise = rng.normal(0, 0.05, (t.size, 2))
    scatter = [np.std((_after("speed_adaptive_filter=1,beta_per_mm=0.02", t, xy + noise) - xy)[500:] @ [0.8, -0.6])
               for xy in (np.zeros((t.size, 2)), _line(60.0)[1])]  # fmt: skip
    gains = [turn / (1 + turn) for turn in 2 * np.pi / RATE_HZ * np.array([1.0, 1 + 0.02 * SPEED])]
    expected = [0.05 * np.sqrt(gain / (2 - gain)) for gain in gains]  # of white noise behind a first-order low-pass
    assert scatter == pytest.approx(expected, rel=0.1)


def test_a_jump_deadband_reports_nothing_until_its_width_and_then_all() -> None:
    t, xy = _drag()
    shown = _after("deadband=0.3", t, xy)
    step = np.hypot(*np.diff(shown, axis=0).T)
    assert np.mean(step == 0) > 0.02
    assert step[step > 0].min() >= 0.3
    moved = np.append(True, step > 0)
    assert np.array_equal(shown[moved], xy[moved])
    assert np.hypot(*(xy - shown).T).max() < 0.3


def test_a_play_stays_behind_by_half_of_its_width() -> None:
    t, xy = _line()
    shown = _after("deadband=0.2,kind=1", t, xy)
    assert np.hypot(*(xy - shown)[5:].T) == pytest.approx(0.1)
    t, xy = _line(speed=45.0)
    late_s = np.hypot(*(xy - _after("deadband=0.2,kind=1", t, xy))[5:].T) / 45.0
    assert late_s == pytest.approx(0.5 * 0.2 / 45.0)


def test_fuzz_has_the_kernel_s_zones() -> None:
    def kernel(value: float, old: float, fuzz: float) -> float:
        if old - fuzz / 2 < value < old + fuzz / 2:
            return old
        if old - fuzz < value < old + fuzz:
            return (old * 3 + value) / 4
        if old - fuzz * 2 < value < old + fuzz * 2:
            return (old + value) / 2
        return value

    t, xy = _drag()
    shown = _after("deadband=0.4,kind=2", t, xy)
    for axis in range(2):
        old = xy[0, axis]
        for i in range(1, t.size):
            old = kernel(xy[i, axis], old, 0.4)
            assert shown[i, axis] == pytest.approx(old, abs=1e-12)
