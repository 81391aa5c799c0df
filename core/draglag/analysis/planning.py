"""Precision of L(v) predicted from a protocol."""

from __future__ import annotations

from collections.abc import Callable, MutableMapping
from dataclasses import dataclass, replace

import numpy as np

from draglag.curve.forms import FORMS
from draglag.latency import estimate_on_clock, with_systematics
from draglag.latency.bound import HandSpectrum, TouchNoise, latency_bound_s
from draglag.protocol.runs import PlannedRun, Protocol, expand, load_protocol
from draglag.recording import FloatArray
from draglag.simulation import Human, Rig, follow, rig_for_screen, simulate_run
from draglag.system.blas import one_blas_thread

FORM = "double_exponential"
GRID_HZ = 1000.0
REHEARSALS = 10  # of each circle: intervals differ by some 20 % from run to run, mostly by what the clock leaves open


@dataclass(frozen=True)
class PlannedPrecision:
    """Predicted precision of one run.

    ``se_s``: by the Cramér–Rao bound and the tremor at the edges; ``half_interval_s`` (95 %): by simulated runs.
    """

    id: str
    nominal_speed_mm_s: float
    n_edges: int
    latency_s: float
    se_s: float
    half_interval_s: float
    note: str = ""

    def to_dict(self) -> dict[str, object]:
        return {
            "id": self.id,
            "nominal_speed_mm_s": self.nominal_speed_mm_s,
            "n_edges": self.n_edges,
            "expected_latency_ms": 1e3 * self.latency_s,
            "se_ms": 1e3 * self.se_s,
            "interval_half_width_ms": 1e3 * self.half_interval_s,
            "note": self.note,
        }


@dataclass(frozen=True)
class Plan:
    """Prediction for a protocol; ``curve_se_s``: None if its runs do not determine Eq. 5."""

    protocol: str
    screen: str
    runs: tuple[PlannedPrecision, ...]
    speed_mm_s: FloatArray
    curve_se_s: FloatArray | None
    duration_s: float

    def to_dict(self) -> dict[str, object]:
        curve = None
        if self.curve_se_s is not None:
            curve = [
                {"speed_mm_s": float(v), "se_ms": 1e3 * float(se), "interval_half_width_ms": 1.96e3 * float(se)}
                for v, se in zip(self.speed_mm_s, self.curve_se_s, strict=True)
            ]
        return {
            "protocol": self.protocol,
            "screen": self.screen,
            "duration_min": self.duration_s / 60,
            "runs": [run.to_dict() for run in self.runs],
            "curve": curve,
        }


@one_blas_thread
def plan(
    protocol: Protocol | str,
    screen: Rig | str,
    human: Human | None = None,
    progress: Callable[[float, str], None] | None = None,
    known: MutableMapping[str, PlannedPrecision] | None = None,
) -> Plan:
    """Predicted precision of a protocol's circles on a screen, and of the curve through them.

    Args:
        protocol, screen: presets or objects; the screen's law and noise are assumed.
        progress: called with the share done and the run's id; may raise to stop.
        known: earlier predictions, used and added to.

    Raises DataError for unknown presets or targets that do not fit.
    """
    rig = rig_for_screen(screen) if isinstance(screen, str) else screen
    plans = load_protocol(protocol) if isinstance(protocol, str) else protocol
    human = human or Human()
    known = {} if known is None else known
    runs = expand(plans, rig.screen, beam=rig.beam)
    circles = []
    for k, run in enumerate(runs):
        if run.kind == "circle":
            if progress is not None:
                progress(k / len(runs), run.id)
            circles.append(_remembered(run, rig, human, known))
    speed = np.array(sorted({run.nominal_speed_mm_s for run in circles}))
    rests_s = plans.rest_s * max(len(runs) - 1, 0)
    total_s = sum(run.duration_s for run in runs) + rests_s
    curve = _curve_se(circles, speed, rig)
    return Plan(plans.name, rig.screen.name, tuple(circles), speed, curve, total_s)


def _remembered(
    run: PlannedRun, rig: Rig, human: Human, known: MutableMapping[str, PlannedPrecision]
) -> PlannedPrecision:
    key = repr((run.target, run.duration_s, run.nominal_speed_mm_s, rig, human))
    if key not in known:
        known[key] = _precision(run, rig, human)
    return replace(known[key], id=run.id)


def _precision(run: PlannedRun, rig: Rig, human: Human) -> PlannedPrecision:
    speed = float(run.nominal_speed_mm_s or 0.0)
    latency_s = float(rig.law.latency_s(speed))
    t_s = np.arange(human.touch_s[1], run.duration_s - latency_s, 1 / GRID_HZ)
    x, y = run.target.position_mm(t_s)
    beam_y = rig.beam.slope * x + rig.beam.intercept_mm
    clear = np.abs(y - beam_y) / np.hypot(1, rig.beam.slope) - rig.stylus.diameter_mm / 2
    k = np.flatnonzero(np.diff(np.sign(clear)) != 0)
    if k.size < 6:
        return PlannedPrecision(run.id, speed, int(k.size), latency_s, float("inf"), float("inf"), "too few edges")
    edge_s = t_s[k] + clear[k] / (clear[k] - clear[k + 1]) / GRID_HZ
    event_s = np.arange(t_s[0], t_s[-1], 1 / rig.touch_rate_hz)
    middle = float(np.mean(run.target.position_mm(t_s)[1]))
    edge_x, edge_y = run.target.position_mm(edge_s)
    edge_v = run.target.velocity_mm_s(edge_s)[1]
    beam_at = rig.beam.slope * edge_x + rig.beam.intercept_mm
    slope_s = float(rig.law.latency_s(speed + 1) - rig.law.latency_s(speed - 1)) / 2
    se_s = latency_bound_s(
        edge_t_s=edge_s,
        edge_x_mm=edge_x,
        edge_v_mm_s=edge_v,
        side=np.where(edge_y > beam_at, 1.0, -1.0),
        event_t_s=event_s,
        event_v_mm_s=run.target.velocity_mm_s(event_s)[1],
        event_y_mm=run.target.position_mm(event_s)[1] - middle,
        noise=TouchNoise(rig.noise_mm, rig.noise_slow_share, rig.noise_slow_s, rig.resolution_mm),
        hand=HandSpectrum(
            human.wander_mm, human.wander_hz, human.timing_sd_s, gain_sd=human.gain_sd, tremor_mm=human.tremor_mm
        ),
        edge_y_mm=float(np.mean(beam_at)) - middle,
    )
    se_s = float(np.hypot(se_s, abs(slope_s) * _tremor_at_edges_mm_s(human, edge_s, clear[k] > 0)))
    half_s = _rehearsed_half_s(run, rig, human)
    if half_s is None:
        return PlannedPrecision(run.id, speed, int(k.size), latency_s, float("inf"), float("inf"), "not identifiable")
    return PlannedPrecision(run.id, speed, int(edge_s.size), latency_s, se_s, half_s, run.note)


def _rehearsed_half_s(run: PlannedRun, rig: Rig, human: Human) -> float | None:
    rng = np.random.default_rng(round(1000 * (run.nominal_speed_mm_s or 0.0)))
    halves_s = []
    for _ in range(REHEARSALS):
        motion = follow(run.target, human, rng)
        recorded = simulate_run(rig, motion, run_id=run.id, planned=run, start_s=0.0, rng=rng)
        ends_s = with_systematics(estimate_on_clock(recorded, (), rig.stylus.diameter_mm)).latency_ci95_s
        if ends_s is not None:
            halves_s.append(0.5 * (ends_s[1] - ends_s[0]))
    return float(np.mean(halves_s)) if 2 * len(halves_s) > REHEARSALS else None


def _tremor_at_edges_mm_s(human: Human, edge_s: FloatArray, falling: np.ndarray) -> float:
    """Standard deviation of a run's mean speed by tremor, which both edges of a crossing share."""
    low_hz, high_hz = HandSpectrum().tremor_hz
    f_hz = np.linspace(low_hz, high_hz, 41)[:, None]
    crossing = np.cumsum(falling) - int(falling[0])
    turned = np.exp(2j * np.pi * f_hz * (edge_s - edge_s[0]))
    sums = np.array([np.bincount(crossing, row.real) + 1j * np.bincount(crossing, row.imag) for row in turned])
    together = (np.abs(sums) ** 2).sum(1) / edge_s.size**2
    return float(human.tremor_mm * np.sqrt(np.mean((2 * np.pi * f_hz[:, 0]) ** 2 * together)))


def _curve_se(circles: list[PlannedPrecision], speed: FloatArray, rig: Rig) -> FloatArray | None:
    good = [run for run in circles if np.isfinite(run.se_s)]
    form = FORMS[FORM]
    law = rig.law
    if len(good) <= form.n_parameters:
        return None
    values = np.array([law.a2_s_per_mm, law.a5_s_per_mm, law.a1_ms, law.a4_ms, law.a7_ms])
    at = np.array([run.nominal_speed_mm_s for run in good])
    variance = np.array([run.se_s for run in good]) ** 2 + rig.run_latency_sd_s**2
    normal_from, wanted = (_derivatives(values, v) for v in (at, speed))
    normal = (normal_from / variance[:, None]).T @ normal_from
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    spread = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-12, hermitian=True) / np.outer(scale, scale)
    return np.asarray(np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", wanted, spread, wanted), 0)))


def _derivatives(values: FloatArray, speed: FloatArray) -> FloatArray:
    a2, a5, a1, a4, _ = values
    fast, slow = np.exp(-a2 * speed), np.exp(-a5 * speed)
    return 1e-3 * np.column_stack([-a1 * speed * fast, -a4 * speed * slow, fast, slow, np.ones_like(speed)])
