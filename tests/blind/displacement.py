"""How far, in mm, each hidden effect moves the edges, and how much of that no law and no beam absorbs.

The session without noise, rounding and missed passes is made with and without the effect. The twin's true law aligns
both; the difference of edge residuals is the effect's.
"""

from dataclasses import dataclass, replace

import numpy as np

from .physics.rig import Profile
from .physics.session import Truth, make_session
from .visibility import TAP_PRECISION_S, law_columns, residuals

OF_INTEREST_MM = 0.05
FARTHEST_MM = 20.0  # an edge next to a hole in the trace shows nothing of the effect


@dataclass(frozen=True)
class Displacement:
    """RMS over all edges of the effect's displacement (`rms_mm`), and of its part beyond Eq. 5 and a straight beam
    (`gap_mm`). `taps_show`: taps and curve differ by what the law absorbs."""

    rms_mm: float
    gap_mm: float
    taps_show: bool = False

    @property
    def matters(self) -> bool:
        """Whether a quiet verdict misses something of interest."""
        return (self.rms_mm if self.taps_show else self.gap_mm) >= OF_INTEREST_MM


def displacements(
    seed: int, effects: dict[str, float], profile: Profile
) -> tuple[dict[str, Displacement], Displacement | None]:
    """Of each effect alone, and of all together (None without any)."""
    if not effects:
        return {}, None
    quiet = replace(profile, noise=0.0)
    twin = make_session(None, seed, {}, quiet)
    alone = {name: displaced_by(make_session(None, seed, {name: size}, quiet), twin) for name, size in effects.items()}
    if len(effects) == 1:
        return alone, next(iter(alone.values()))
    return alone, displaced_by(make_session(None, seed, effects, quiet), twin)


def displaced_by(truth: Truth, twin: Truth) -> Displacement:
    """What everything hidden in `truth` does to the edges of its twin."""
    with_it, without = residuals(truth, twin), residuals(twin, twin)
    moved, columns = [], []
    for run_id in with_it.keys() & without.keys():
        (r1, at1), (r0, at0) = with_it[run_id], without[run_id]
        _, i1, i0 = np.intersect1d(at1, at0, return_indices=True)
        base, at = twin.details[run_id], at0[i0]
        vy, v = base["vy_mm_s"][at], base["speed_mm_s"][at]
        delta = r1[i1] - r0[i0]
        good = np.abs(delta) < FARTHEST_MM
        moved.append(delta[good])
        shape = np.column_stack([law_columns(twin.rig, vy, v), np.ones_like(vy), base["x_mm"][at]])
        columns.append(shape[good])
    taps = twin.rig.taps_before + twin.rig.taps_after > 0
    taps_show = taps and any(
        abs(truth.effects.get(name, 0.0)) > 2 * TAP_PRECISION_S for name in ("clock_offset", "prediction")
    )
    if not moved or sum(map(len, moved)) < 10:
        return Displacement(0.0, 0.0, taps_show)
    delta, shape = np.concatenate(moved), np.concatenate(columns)
    shape = shape / np.maximum(np.linalg.norm(shape, axis=0), 1e-300)
    left = delta - shape @ np.linalg.lstsq(shape, delta, rcond=1e-9)[0]
    return Displacement(float(np.sqrt(np.mean(delta**2))), float(np.sqrt(np.mean(left**2))), taps_show)
