"""How each effect moves the residual of an edge: its signature, linear in its size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_diag, csr_matrix

from draglag.gap.edges import Placed, sparse_rows
from draglag.gap.model import Geometry, LawParameters, side_of
from draglag.gap.unwarped import Unwarped
from draglag.recording import FloatArray


@dataclass(frozen=True)
class View:
    """The motion at every edge as signatures see it, (m,) each, mm and s; across = positive downwards."""

    x_mm: FloatArray
    y_mm: FloatArray
    side: FloatArray
    rising: FloatArray
    v_across: FloatArray
    speed: FloatArray
    accel: FloatArray
    a_across: FloatArray
    since_start_s: FloatArray
    in_run_s: FloatArray
    latency_s: FloatArray
    law_slope: FloatArray
    stretch: FloatArray
    angle: FloatArray
    width_mm: float
    panel_x: FloatArray  # −1 … +1 over the panel
    session_time: FloatArray  # −1 … +1 over the session
    span_s: float
    intercept_mm: float
    averaged: Averaged
    trace: Unwarped


@dataclass(frozen=True)
class Averaged:
    """How a displacement of the events becomes one of the edges: rows (m, n) of weights over all events, (n,) mm."""

    rows: csr_matrix
    x_mm: FloatArray
    y_mm: FloatArray

    def __getitem__(self, use: np.ndarray) -> Averaged:
        return Averaged(self.rows[use], self.x_mm, self.y_mm)


@dataclass(frozen=True)
class Signature:
    """Columns of one effect at one setting of what it is not linear in.

    Attributes:
        latency: (m, k) latency added per unit, s; offset: (m, k) displacement across the beam per unit, mm.
        theta: the setting. n_grid: how many settings are tried in all, for the penalty. looks: how many of them
            were looked at for each one tried in earnest.
    """

    latency: FloatArray | None = None
    offset: FloatArray | None = None
    theta: tuple[float, ...] = ()
    n_grid: int = 1
    looks: float = 1.0

    def columns(self, view: View) -> FloatArray:
        """The residual the effect leaves when it is not modelled, (m, k) mm per unit."""
        parts = []
        if self.latency is not None:
            parts.append(-(view.v_across * view.stretch)[:, None] * self.latency)
        if self.offset is not None:
            parts.append(self.offset)
        return parts[0] if len(parts) == 1 else parts[0] + parts[1]


def view_of(placed: Placed, law: LawParameters, geometry: Geometry, width_mm: float) -> View:
    t = placed.since_start_s
    span = max(float(np.ptp(t)), 1.0)
    speed = np.maximum(placed.speed_mm_s, 1.0)
    # Where the model says the edge was: the measured y holds the residual itself.
    line = geometry.slope * placed.xy_mm[:, 0] + geometry.intercept_mm + 0.5 * geometry.diameter_mm * side_of(placed)
    return View(
        placed.xy_mm[:, 0],
        line,
        side_of(placed),
        (~placed.falling).astype(float),
        placed.v_mm_s[:, 1] - geometry.slope * placed.v_mm_s[:, 0],
        speed,
        placed.accel_apart_mm_s2,
        placed.a_mm_s2[:, 1],
        t,
        placed.in_run_s,
        placed.latency_s,
        placed.slope_s2_mm,
        placed.stretch,
        np.arctan2(placed.v_mm_s[:, 1], placed.v_mm_s[:, 0]),
        width_mm,
        2 * placed.xy_mm[:, 0] / width_mm - 1,
        2 * (t - t.min()) / span - 1,
        span,
        geometry.intercept_mm,
        averaged_of(placed),
        placed.trace,
    )


def averaged_of(placed: Placed) -> Averaged:
    """The weights by which each edge's position is averaged from the events of its run."""
    blocks = [
        sparse_rows(fit.first, fit.weights, events.shape[0])
        for fit, events in zip(placed.position_fit, placed.events_mm, strict=True)
    ]
    x_mm, y_mm = np.concatenate(placed.events_mm).T
    return Averaged(csr_matrix(block_diag(blocks)), x_mm, y_mm)


def _column(values: FloatArray) -> FloatArray:
    return values[:, None]


def clock_drift(v: View) -> list[Signature]:
    # Seconds per second: the laser's clock gains, so its stamps lie later and the latency reads shorter.
    return [Signature(latency=_column(-v.since_start_s))]


def thermal_drift(v: View) -> list[Signature]:
    return [Signature(latency=_column(v.since_start_s))]


def laser_hysteresis(v: View) -> list[Signature]:
    return [Signature(latency=_column(-v.rising))]


def beam_width(v: View) -> list[Signature]:
    return [Signature(offset=_column(0.5 * v.side))]


def beam_wedge(v: View) -> list[Signature]:
    return [Signature(offset=_column(0.25 * v.side * v.panel_x))]


def direction_asymmetry(v: View) -> list[Signature]:
    # Between moving down and moving up, half each way.
    return [Signature(latency=_column(0.5 * np.sign(v.v_across)))]


LAGS_S3_MM = (0.0, 4e-6, 8e-6, 1.2e-5, 2e-5)


def acceleration_lag(v: View) -> list[Signature]:
    # As the trace shows it, amplified by the effect itself: enough to find it. Its own size takes that back.
    return [Signature(latency=_column(v.accel), theta=(0.0,), n_grid=len(LAGS_S3_MM))]


def unwarped_lag(v: View, lag_s3_mm: float) -> Signature:
    """The acceleration behind a trace that a lag of this size has warped."""
    column = v.trace.acceleration_mm_s2(lag_s3_mm) if lag_s3_mm > 0 else v.accel
    return Signature(latency=_column(column), theta=(lag_s3_mm,), n_grid=len(LAGS_S3_MM))


def lagging_law(v: View) -> list[Signature]:
    # A speed some time ago; or (negative) one towards the present, which is a latency later than the edge's own.
    past = Signature(latency=_column(-v.law_slope * v.accel), theta=(0.0,), n_grid=2)
    present = Signature(latency=_column(-v.law_slope * v.accel * v.latency_s / 0.05), theta=(1.0,), n_grid=2)
    return [past, present]


def scan_skew(v: View) -> list[Signature]:
    return [Signature(latency=_column(0.5 * v.panel_x))]


def spatial_warp(v: View) -> list[Signature]:
    x = v.panel_x
    polynomial = np.column_stack([x**2 - x.mean(), x**3, x**4])
    return [Signature(offset=polynomial)] + [
        Signature(offset=np.column_stack([np.sin(k * np.pi * x), np.cos(k * np.pi * x)]), theta=(k,), n_grid=4)
        for k in (0.75, 1.0, 1.5, 2.0)
    ]


PITCHES_MM = np.geomspace(3.0, 10.0, 300)
PITCHES_TRIED = 8


def pitch_ripple(v: View, residual: Callable[[FloatArray], FloatArray] | None = None) -> list[Signature]:
    """Columns only, or rows too: the electrodes' lattice displaces every event, and an edge sees them averaged.

    Over a wide panel a pitch has to be right to half a percent. The pitches tried in earnest are those of the largest
    lines in the spectrum over the edges' own x and y; how many were passed over counts for the price and the odds.

    Args:
        residual: maps columns (m, k) to the white residual's gain by each pair of them, (k / 2,).
    """
    pitches = PITCHES_MM
    if residual is not None:
        lines = np.zeros(pitches.size)
        for at_mm in (v.x_mm, v.y_mm):
            phase = 2 * np.pi * at_mm[:, None] / pitches
            lines += residual(np.stack([np.sin(phase), np.cos(phase)], axis=2).reshape(at_mm.size, -1))
        pitches = pitches[np.argsort(-lines)[:PITCHES_TRIED]]
    looks = PITCHES_MM.size / pitches.size
    return [ripple(v, float(p), both, 2 * PITCHES_MM.size, looks) for p in pitches for both in (0.0, 1.0)]


def ripple(v: View, pitch_mm: float, both: float, n_grid: int = 1, looks: float = 1.0) -> Signature:
    """One pitch, along x alone or along both axes."""
    phase = 2 * np.pi / pitch_mm * np.column_stack([v.averaged.x_mm, v.averaged.y_mm][: 2 if both else 1])
    seen = v.averaged.rows @ np.column_stack([np.sin(phase), np.cos(phase)])
    columns = seen[:, [0, 2, 1, 3]] if both else seen  # sin and cos along x, then along y
    return Signature(offset=columns, theta=(pitch_mm, both), n_grid=n_grid, looks=looks)


def smoothing_shrink(v: View) -> list[Signature]:
    # A first-order low-pass with time constant τ whose delay the law already holds leaves ½ τ² of acceleration.
    return [Signature(offset=_column(0.5 * v.a_across))]


def second_filter_mode(v: View) -> list[Signature]:
    # A stronger filter above some speed, or while the stylus speeds up or slows down.
    out = []
    for kind, values in enumerate((v.speed, np.abs(v.accel))):
        limits = np.quantile(values, np.linspace(0.12, 0.88, 16))
        out += [mode(v, float(limit), float(kind), 32) for limit in limits]
    return out


def mode(v: View, limit: float, kind: float, n_grid: int = 1) -> Signature:
    """More latency above a speed (kind 0) or above an acceleration (1)."""
    values = np.abs(v.accel) if kind else v.speed
    return Signature(latency=_column((values > limit).astype(float)), theta=(limit, kind), n_grid=n_grid)


SIGNATURES: dict[str, Callable[[View], list[Signature]]] = {
    "clock_drift": clock_drift,
    "laser_hysteresis": laser_hysteresis,
    "beam_width": beam_width,
    "beam_wedge": beam_wedge,
    "direction_asymmetry": direction_asymmetry,
    "acceleration_lag": acceleration_lag,
    "lagging_law": lagging_law,
    "scan_skew": scan_skew,
    "spatial_warp": spatial_warp,
    "pitch_ripple": pitch_ripple,
    "smoothing_shrink": smoothing_shrink,
    "second_filter_mode": second_filter_mode,
}


def signature_at(effect: str, theta: tuple[float, ...], v: View) -> Signature:
    """The signature of an effect at a setting; the nearest of its grid where it has one."""
    if effect == "pitch_ripple" and theta:
        return ripple(v, theta[0], theta[1])
    if effect == "acceleration_lag" and theta:
        return unwarped_lag(v, theta[0])
    if effect == "second_filter_mode" and theta:
        return mode(v, theta[0], theta[1])
    options = SIGNATURES[effect](v)
    if not theta:
        return options[0]
    options = [o for o in options if len(o.theta) == len(theta)]
    distance = [
        abs(o.theta[0] - theta[0]) + 1e3 * sum(a != b for a, b in zip(o.theta[1:], theta[1:], strict=True))
        for o in options
    ]
    return options[int(np.argmin(distance))]


def _spline(values: FloatArray, knots: int) -> FloatArray:
    """Natural cubic spline basis without its constant, knots at quantiles, columns of unit spread."""
    at = np.unique(np.quantile(values, np.linspace(0, 1, knots)))
    if at.size < 3:
        scaled = values - values.mean()
        spread = float(scaled.std())
        return scaled[:, None] / spread if spread > 0 else np.empty((values.size, 0))

    def d(k: int) -> FloatArray:
        cube = np.maximum(values - at[k], 0) ** 3 - np.maximum(values - at[-1], 0) ** 3
        return np.asarray(cube / (at[-1] - at[k]))

    reference = d(at.size - 2)
    basis = [values] + [d(k) - reference for k in range(at.size - 2)]
    out = np.column_stack(basis)
    out = out - out.mean(0)
    spread = out.std(0)
    return np.asarray(out[:, spread > 1e-12] / spread[spread > 1e-12])


def shape_free(v: View) -> dict[tuple[str, str], FloatArray]:
    """(covariate, role) → residual columns of a smooth term: what an effect in no library would follow."""
    covariates = {
        "session_time": (v.session_time, 5),
        "time_in_run": (v.in_run_s, 5),
        "x": (v.panel_x, 6),
        "speed": (np.log(v.speed), 7),
        "acceleration": (np.arcsinh(v.accel / 500), 5),
        "normal_acceleration": (np.arcsinh(v.a_across / 500), 5),
    }
    out = {}
    lever = v.v_across * v.stretch
    for name, (values, knots) in covariates.items():
        basis = _spline(values, knots)
        if basis.shape[1] == 0:
            continue
        out[name, "latency"] = -lever[:, None] * basis
        out[name, "offset"] = basis
        out[name, "width"] = 0.5 * v.side[:, None] * basis
        out[name, "direction"] = -lever[:, None] * np.sign(v.v_across)[:, None] * basis
    harmonics = np.column_stack([f(k * v.angle) for k in (1, 2) for f in (np.sin, np.cos)])
    out["direction_angle", "latency"] = -lever[:, None] * harmonics
    return out
