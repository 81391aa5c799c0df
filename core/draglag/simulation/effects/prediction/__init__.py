"""The panel or the host extrapolates the stylus's path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect, TouchEvents, each_contact
from draglag.simulation.effects.in_fits import Z95, FittedTerm, Parameters, Theta, Undoing
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.effects.prediction.extrapolation import extrapolated
from draglag.simulation.residual import LineGains, Signature, View, bent

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.state import Term
    from draglag.gap.traces.run_data import RunData

WINDOW_S = 0.02  # over which screens measure the velocity
SHORTEST_S = 1e-3  # of a horizon: a shorter one moves nothing
STEP = 2.0  # factor between the windows at which traces are looked at: events do not identify it better


@dataclass(frozen=True)
class Prediction(Effect):
    id: ClassVar[str] = "prediction"
    meaning: ClassVar[str] = (
        "Reported positions are extrapolated by this time, with the velocity over the last events: drags are shown "
        "earlier, taps are not. A tracker that swings wide in curves (alpha-beta, Kalman) looks the same on edges; "
        "only the noise of its events is smoother."
    )
    in_detail: ClassVar[str] = "The velocity is the way from the position a window ago, over the window."
    follows: ClassVar[str] = "normal_acceleration"
    refitted_by: ClassVar[str] = "draglag.simulation.effects.prediction.refits"
    separated_by: ClassVar[str] = "taps on the same clock: a clock's offset moves them, a prediction does not"
    drags_early: ClassVar[int] = 1
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("horizon_s", "s", 0.0, 0.1, 0.015),
        Parameter("window_s", "s", 0.005, 0.1, WINDOW_S),
    )
    order: ClassVar[int] = -1

    window_s: float = WINDOW_S

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        return each_contact(events, lambda t_s, xy_mm: extrapolated(t_s, xy_mm, self.value, self.window_s))

    def stamped_late_s(self) -> float:
        """Minus the horizon, which fits have in their law."""
        return -self.value

    @classmethod
    def columns_at(cls, theta: Theta, view: View) -> tuple[Signature, ...]:
        """Displacement −h (h + w) / 2 times the acceleration, for theta = (h, w), horizon and window; h is the size."""
        horizon_s, window_s = (*theta, WINDOW_S)[:2]
        return (bent(view, -0.5 * (window_s + horizon_s), theta=theta),)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        """One column of size h (h + w), s²."""
        return [bent(view, -0.5)]

    @classmethod
    def signature_at(cls, theta: Theta, view: View) -> Signature:
        return bent(view, -0.5, theta=theta)

    @classmethod
    def undoing(cls, term: Term, runs: tuple[RunData, ...]) -> tuple[Undoing | None, Term]:
        from draglag.simulation.effects.prediction.undone import Unpredicted

        return Unpredicted(*term.theta) if term.theta else None, term

    @classmethod
    def whole_sizes(cls, term: Term, fit: Fit) -> FloatArray:
        horizon_s, window_s = term.theta or (0.0, WINDOW_S)
        return np.array(term.sizes) + horizon_s * (horizon_s + window_s)

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        """Horizon at the traces' window; its interval spans neighbouring windows, or all."""
        low, size, high = (max(found.sizes[0] + s * Z95 * found.se[0], 0.0) for s in (-1, 0, 1))
        horizon, window = cls.parameters
        window_s, reach = WINDOW_S, (window.lower, window.upper)
        if found.term.theta:
            window_s = found.term.theta[1]
            reach = window_s / STEP, window_s * STEP
        ends = horizon_of(low, reach[1]), horizon_of(high, reach[0])
        return {horizon.name: (horizon_of(size, window_s), ends), window.name: (window_s, reach)}

    @classmethod
    def with_taps(cls, parameters: Parameters, value: float, ci95: tuple[float, float]) -> Parameters | None:
        """Horizon from taps or curves, whichever is surer; window from curves."""
        horizon, window = cls.parameters
        (by_curves_s, reach_s), (window_s, _) = parameters[horizon.name], parameters[window.name]
        low, high = max(ci95[0], reach_s[0]), min(ci95[1], reach_s[1])
        if low > high:
            return None
        surer_s = value if ci95[1] - ci95[0] < reach_s[1] - reach_s[0] else by_curves_s
        horizons_s = np.clip([surer_s, low, high], max(low, SHORTEST_S), max(high, SHORTEST_S))
        size_s2 = by_curves_s * (by_curves_s + window_s)
        windows_s = np.clip(size_s2 / horizons_s - horizons_s, window.lower, window.upper)
        span_s = float(windows_s.min()), float(windows_s.max())
        return {horizon.name: (float(horizons_s[0]), (low, high)), window.name: (float(windows_s[0]), span_s)}


def horizon_of(size_s2: float, window_s: float) -> float:
    """h of h (h + window) = size."""
    return float(np.sqrt(0.25 * window_s**2 + size_s2) - 0.5 * window_s)
