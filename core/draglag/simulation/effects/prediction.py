"""The panel or the host extrapolates the stylus's path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Confounder, Effect, Parameter, TouchEvents, each_contact
from draglag.simulation.residual import Signature, View, column

WINDOW_S = 0.02  # over which screens measure the velocity


@dataclass(frozen=True)
class Prediction(Effect):
    """The panel or the host extrapolates the stylus's path."""

    id: ClassVar[str] = "prediction"
    meaning: ClassVar[str] = (
        "Reported positions are extrapolated by this time, with the velocity over the last events: drags are shown "
        "earlier, taps are not."
    )
    follows: ClassVar[str] = "normal_acceleration"
    separated_by: ClassVar[str] = "taps on the same clock: a clock's offset moves them, a prediction does not"
    parts_taps_from_drags: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("horizon_s", "s", 0.0, 0.1, 0.015),
        Parameter("window_s", "s", 0.005, 0.1, WINDOW_S),
    )
    confounded_with: ClassVar[tuple[Confounder, ...]] = (
        Confounder("clock_offset", "both move every edge by the same time", "taps on the same clock"),
        Confounder("curve constant", "an earlier position is a smaller constant of the curve", "taps"),
        Confounder(
            "smoothing_shrink",
            "on curves an extrapolation lies outside of the path, as if less were smoothed",
            "circles of two radii at the same speed, and taps",
        ),
    )
    order: ClassVar[int] = -1

    window_s: float = WINDOW_S

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        return each_contact(events, lambda t_s, xy_mm: _extrapolated(t_s, xy_mm, self.value, self.window_s))

    def stamped_late_s(self) -> float:
        """The horizon: a fit has it in its law, and the simulation adds it again."""
        return -self.value

    @classmethod
    def columns_at(cls, theta: tuple[float, ...], view: View) -> Signature:
        """Drags earlier by the horizon h, and h d + h²/2 times the acceleration outside of curves, d half the
        velocity's window: size h is the whole at theta = (h, window)."""
        horizon_s, window_s = (*theta, WINDOW_S)[:2]
        late = column(np.full(view.speed.size, -1.0))
        return Signature(latency=late, offset=column(-0.5 * (window_s + horizon_s) * view.a_across), theta=theta)


def _window_start(t_s: FloatArray, window_s: float) -> tuple[np.ndarray, FloatArray, FloatArray]:
    """A window ago, (n,): event before, share of the way to the next, span in time."""
    at_s = np.maximum(t_s - window_s, t_s[0])
    begin = np.clip(np.searchsorted(t_s, at_s, side="right") - 1, 0, max(t_s.size - 2, 0))
    after = np.minimum(begin + 1, t_s.size - 1)
    share = np.clip((at_s - t_s[begin]) / np.maximum(t_s[after] - t_s[begin], 1e-9), 0.0, 1.0)
    return begin, share, np.maximum(t_s - at_s, 1e-3)


def _extrapolated(t_s: FloatArray, xy_mm: FloatArray, horizon_s: float, window_s: float) -> FloatArray:
    if t_s.size < 2:
        return xy_mm
    begin, share, span_s = _window_start(t_s, window_s)
    back = xy_mm[begin] + share[:, None] * (xy_mm[begin + 1] - xy_mm[begin])
    return np.asarray(xy_mm + horizon_s * (xy_mm - back) / span_s[:, None])
