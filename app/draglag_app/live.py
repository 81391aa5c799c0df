"""Numbers for live plots."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from draglag.path.local_fit import local_fit
from draglag.protocol.runs import PlannedRun
from draglag.recording import FloatArray
from draglag_app.session.events import SamplesArrived

# Half width of the fits behind the live speed: a compromise between noise and the sharpest turns.
_HALF_S = 0.06
_MOST_POINTS = 40_000
# Fits closer together add no information, but cost time that the participant's target needs.
_SPACING_S = 0.01


@dataclass
class LiveRun:
    """One run as it arrives; times from the target's start."""

    run_id: str
    planned: PlannedRun | None
    start_s: float
    count: int = 0
    n_edges: int = 0
    touch: list[FloatArray] = field(default_factory=lambda: [np.empty((0, 3))])
    edges: list[FloatArray] = field(default_factory=lambda: [np.empty((0, 2))])
    speed: list[FloatArray] = field(default_factory=lambda: [np.empty((0, 2))])

    def add(self, samples: SamplesArrived) -> None:
        """Add a digest; one of another run is ignored."""
        if samples.run_id != self.run_id:
            return
        if len(samples.t_s):
            self.count += samples.count
            if sum(len(part) for part in self.touch) < _MOST_POINTS:
                self.touch.append(np.column_stack([samples.t_s - self.start_s, samples.x_mm, samples.y_mm]))
        if len(samples.edge_s):
            self.n_edges += len(samples.edge_s)
            self.edges.append(np.column_stack([samples.edge_s - self.start_s, samples.light]))

    def trace(self) -> FloatArray:
        """(n, 3) time s, x mm, y mm."""
        return _joined(self.touch)

    def edges_on_screen(self) -> FloatArray:
        """(m, 3) x mm, y mm of the touch at each edge, without latency; 1 where light came."""
        trace, edges = self.trace(), _joined(self.edges)
        if len(trace) < 2 or not len(edges):
            return np.empty((0, 3))
        x_mm, y_mm = (np.interp(edges[:, 0], trace[:, 0], trace[:, k]) for k in (1, 2))
        return np.column_stack([x_mm, y_mm, edges[:, 1]])

    def speeds(self) -> FloatArray:
        """(k, 2) time s, speed mm/s so far."""
        trace, known = self.trace(), _joined(self.speed)
        from_s = known[-1, 0] if len(known) else -np.inf
        fresh = trace[trace[:, 0] > from_s - 4 * _HALF_S]
        if len(fresh) > 8 and fresh[-1, 0] - fresh[0, 0] > 3 * _HALF_S:
            at_s = fresh[(fresh[:, 0] > from_s + _SPACING_S) & (fresh[:, 0] < fresh[-1, 0] - _HALF_S), 0]
            if len(at_s):
                every_s = float(np.median(np.diff(fresh[:, 0])))
                at_s = at_s[:: max(2, round(_SPACING_S / max(every_s, 1e-6)))]
                fit = local_fit(fresh[:, 0], fresh[:, 1:], at_s, _HALF_S)
                speed = np.where(fit.ok, fit.speed_mm_s, np.nan)
                self.speed.append(np.column_stack([at_s, speed]))
        return _joined(self.speed)


def _joined(parts: list[FloatArray]) -> FloatArray:
    if len(parts) > 1:
        parts[:] = [np.concatenate(parts)]
    return parts[0]
