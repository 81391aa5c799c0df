"""Signatures of effects, and smooth unnamed terms."""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.sparse import csr_matrix

from draglag.gap.constants import LAW_LENGTH
from draglag.gap.fitting.model import Geometry, LawParameters, side_of
from draglag.gap.traces.edges import Placed
from draglag.recording import FloatArray
from draglag.simulation.effects import EFFECTS, Effect
from draglag.simulation.residual import Averaged, Signature, View, column

COLUMNS = {
    name: effect.signatures
    for name, effect in EFFECTS.items()
    if effect.signatures.__func__ is not Effect.signatures.__func__  # type: ignore[attr-defined]
}
"""Effects that residuals show."""

MARGIN = 0.1  # of the panel's width beyond its edges. Judgement
JUMPS = np.linspace(0.06, 0.94, 24)  # of the edges from left to right: where a jump is looked for. Derived: cost
MOMENTS = np.linspace(0.2, 0.8, 24)  # of the session: some runs have to lie before it and some after. Derived
SPEEDS = np.linspace(0.02, 0.98, 24)  # of the span of ln v: where the latency may be another. Derived: cost
# Of ln v, a standard deviation: its spectrum is beyond that of the curve's own form. Derived.
NARROW = LAW_LENGTH / 3


def view_of(placed: Placed, law: LawParameters, geometry: Geometry, width_mm: float) -> View:
    t = placed.since_start_s
    span = max(float(np.ptp(t)), 1.0)
    speed = np.maximum(placed.speed_mm_s, 1.0)
    # Next to a hole in the trace a fit may lie anywhere: effects of the place are not evaluated far off the panel.
    x_mm = np.clip(placed.xy_mm[:, 0], -MARGIN * width_mm, (1 + MARGIN) * width_mm)
    # Where the model says the edge was: the measured y contains the residual itself.
    line = geometry.slope * x_mm + geometry.intercept_mm + 0.5 * geometry.diameter_mm * side_of(placed)
    return View(
        x_mm,
        line,
        side_of(placed),
        (~placed.falling).astype(float),
        placed.v_mm_s[:, 1] - geometry.slope * placed.v_mm_s[:, 0],
        speed,
        placed.accel_apart_mm_s2,
        placed.a_mm_s2[:, 1],
        placed.turn_rad_s,
        t,
        placed.in_run_s,
        placed.steady,
        placed.latency_s,
        placed.slope_s2_mm,
        placed.stretch,
        np.arctan2(placed.v_mm_s[:, 1], placed.v_mm_s[:, 0]),
        width_mm,
        2 * x_mm / width_mm - 1,
        2 * (t - t.min()) / span - 1,
        span,
        geometry.intercept_mm,
        averaged_of(placed),
        placed.trace,
        law,
    )


def averaged_of(placed: Placed) -> Averaged:
    """Weights of events in edges' positions."""
    x_mm, y_mm = placed.traces.smooth_mm.T
    return Averaged(partial(_position_rows, placed), x_mm, y_mm, placed.traces.t_s, placed.traces.xy_mm)


def _position_rows(placed: Placed) -> csr_matrix:
    return placed.position_rows


def _spline(values: FloatArray, knots: int) -> FloatArray:
    """Natural cubic splines without constant, of unit spread."""
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


def _settled_s(v: View) -> FloatArray:
    """Time in the run; constant in chirps, where it means frequency."""
    return (
        np.where(v.steady, v.in_run_s, np.median(v.in_run_s[v.steady])) if v.steady.any() else np.zeros(v.steady.size)
    )


def shape_free(v: View) -> dict[tuple[str, str], FloatArray]:
    """(covariate, role) → columns of a smooth, unnamed term."""
    covariates = {
        "session_time": (v.session_time, 5),
        "time_in_run": (_settled_s(v), 5),
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
        # A constant offset or latency is the beam's or the law's; one by side or direction is nobody's.
        whole = np.column_stack([np.ones(v.speed.size), basis])
        out[name, "width"] = 0.5 * v.side[:, None] * whole
        out[name, "direction"] = -lever[:, None] * np.sign(v.v_across)[:, None] * whole
    harmonics = np.column_stack([f(k * v.angle) for k in (1, 2) for f in (np.sin, np.cos)])
    out["direction_angle", "latency"] = -lever[:, None] * harmonics
    return out


def jumps(v: View) -> list[tuple[str, str, Signature]]:
    """(covariate, role, signature) of jumps in position or latency, and of a latency about one speed."""
    at = np.quantile(v.x_mm, JUMPS)
    shifted = v.averaged.rows @ (v.averaged.x_mm[:, None] > at).astype(float)
    out = []
    for k, line in enumerate(at):
        where = (float(line),)
        out.append(("x", "jump", Signature(offset=column(shifted[:, k]), theta=where)))
        late = column((v.x_mm > line).astype(float))
        out.append(("x", "latency jump", Signature(latency=late, theta=where)))
    for moment in np.quantile(v.session_time, [0, 1]) @ np.vstack([1 - MOMENTS, MOMENTS]):
        later = column((v.session_time > moment).astype(float))
        where = (float(moment),)
        out.append(("session_time", "jump", Signature(offset=later, theta=where)))
        out.append(("session_time", "latency jump", Signature(latency=later, theta=where)))
    ln = np.log(v.speed)
    for middle in np.quantile(ln, [0, 1]) @ np.vstack([1 - SPEEDS, SPEEDS]):
        near = column(np.exp(-0.5 * ((ln - middle) / NARROW) ** 2))
        out.append(("speed", "latency bump", Signature(latency=near, theta=(float(middle),))))
    return out
