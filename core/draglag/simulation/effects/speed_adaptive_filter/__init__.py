"""The 1 euro filter: smooths less the faster the stylus moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from draglag.path.events import first_of_contact
from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect, TouchEvents, each_contact
from draglag.simulation.effects.in_fits import Z95, FittedTerm, Parameters, Theta, Undoing
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.effects.speed_adaptive_filter.filtering import (
    DERIVATIVE_HZ,
    Setting,
    cut_off_hz,
    filtered,
)
from draglag.simulation.residual import LineGains, Signature, View, bent

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.state import Term
    from draglag.gap.traces.edges import Placed
    from draglag.gap.traces.run_data import RunData

USUAL, OF_SCREENS_SD = Setting(1.0, 0.02), 0.5
"""Middle of screens' filters, and standard deviation of the logarithm of either parameter (fact sheet on real screens:
0.6 to 1.5 Hz, 0.01 to 0.05 per mm)."""
SETTINGS = tuple(Setting(fmin, beta) for fmin in (0.7, 1.3) for beta in (0.01, 0.02, 0.045))
"""Settings tried: the range of screens by factors of two."""
SMOOTHER_SD = 0.15
"""Of the logarithm of either parameter: a local fit's velocity is smoother than the filter's. Calibrated: generated
filters were off by 0.02 to 0.4, the most where the law falls as the filter's delay does."""
LEAST_UNSURE = 1e-3  # of a parameter's logarithm: a filter's own arithmetic is known to no better
MOST_UNKNOWN = 5.0  # of a parameter's logarithm: a factor of 150 is nothing known
SETTLES_S = 1.0  # of the velocity that the filter follows: after it 0.2 % of where it began is left
HELD = 1e-3  # of a parameter's logarithm in a fit: its columns hold next to a setting, refits move that


@dataclass(frozen=True)
class SpeedAdaptiveFilter(Effect):
    id: ClassVar[str] = "speed_adaptive_filter"
    title: ClassVar[str] = "speed-adaptive filter"
    meaning: ClassVar[str] = (
        "Positions pass a first-order low-pass whose cut-off rises with the speed, from this one at rest (1 euro "
        "filter)."
    )
    in_detail: ClassVar[str] = (
        "One cut-off for both axes, fmin + β |v|, with v the change of the raw positions from report to "
        "report behind a low-pass of 1 Hz. The filter comes after the panel's own latency and adds its delay "
        "to it."
    )
    follows: ClassVar[str] = "speed"
    where: ClassVar[str] = "where the speed changes"
    separated_by: ClassVar[str] = "a chirp or step whose speed changes quickly"
    undone_in: ClassVar[str] = "law of speed"
    refitted_by: ClassVar[str] = "draglag.simulation.effects.speed_adaptive_filter.refits"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        # Beyond them it is a low-pass whose cut-off hardly follows the speed, or none.
        Parameter("fmin_hz", "Hz", 0.1, 5.0, USUAL.fmin_hz, title="lowest cut-off"),
        Parameter(
            "beta_per_mm",
            "1/mm",
            0.002,
            0.2,
            USUAL.beta_per_mm,
            title="rise of the cut-off",
            read_as=("Hz/(mm/s)", 1.0),
        ),
    )
    order: ClassVar[int] = -2
    prior_sd: ClassVar[float] = HELD

    beta_per_mm: float = USUAL.beta_per_mm

    def events(self, events: TouchEvents, rng: np.random.Generator) -> TouchEvents:
        setting = Setting(self.value, self.beta_per_mm)
        return each_contact(events, lambda t_s, xy_mm: filtered(t_s, xy_mm, setting, _one_contact(t_s)))

    @classmethod
    def curve_extra_s(cls, speed_mm_s: FloatArray, parameters: Mapping[str, float]) -> FloatArray | float:
        """Delay at constant speed on a straight line."""
        fmin_hz, beta_per_mm = (parameters.get(spec.name, spec.typical) for spec in cls.parameters)
        return 1 / (2 * np.pi * (fmin_hz + beta_per_mm * speed_mm_s))

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        return [cls.signature_of(setting, view) for setting in SETTINGS]

    @classmethod
    def signature_of(cls, setting: Setting, view: View) -> Signature:
        """Smoothed speed and shrunk path of traces with the filter, to second order in its delay."""
        delay_s, _ = _delays_s(view, setting)
        return bent(view, 0.5 * delay_s**2, delay_s, setting)

    @classmethod
    def signature_at(cls, theta: Theta, view: View) -> Signature:
        """Columns of both parameters' logarithms in a freed trace, from smoothed speeds: single events add the edge's
        noise."""
        delay_s, at_rest = _delays_s(view, Setting(*theta[:2]))
        less_s = -delay_s[:, None] * np.column_stack([at_rest, 1 - at_rest])
        return Signature(less_s, less_s * (delay_s * view.a_across)[:, None], theta)

    @classmethod
    def undoing(cls, term: Term, runs: tuple[RunData, ...]) -> tuple[Undoing | None, Term]:
        from draglag.simulation.effects.speed_adaptive_filter.freed import Unfiltered

        return Unfiltered(Setting(*term.theta[:2])) if term.theta else None, term

    @classmethod
    def unsure_mm(cls, term: Term, placed: Placed) -> FloatArray:
        """By how much an edge lies elsewhere if the filter moved already when the trace begins, (m,)."""
        first_s = np.array([data.t_s[0] for data in placed.traces.runs])[placed.run]
        since_s = placed.t_s + placed.latency_s - first_s
        forgotten = np.exp(-2 * np.pi * DERIVATIVE_HZ * np.maximum(since_s, 0.0))
        begun_hz = term.theta[0] + term.theta[1] * placed.speed_mm_s * (1 - forgotten)
        moving_hz = term.theta[0] + term.theta[1] * placed.speed_mm_s
        later_s = (1 / begun_hz - 1 / moving_hz) / (2 * np.pi)
        return np.where(since_s < SETTLES_S, np.abs(placed.v_mm_s[:, 1]) * later_s / np.sqrt(3), 0.0)

    @classmethod
    def whole_sizes(cls, term: Term, fit: Fit) -> FloatArray:
        """Sizes plus 1, the whole cut-off, to first order."""
        return np.array(term.sizes) + 1.0

    @classmethod
    def log_prior_of(cls, theta: Theta) -> float:
        """Log prior among screens, times the share left by the edges (Laplace's approximation)."""
        setting = Setting(*theta)
        off = setting.logs_from(USUAL) / OF_SCREENS_SD
        left = np.maximum(setting.unsure, LEAST_UNSURE) / OF_SCREENS_SD
        return float(np.sum(np.log(left) - 0.5 * off**2))

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        """Setting with its intervals."""
        setting = Setting(*found.term.theta)
        reach = np.exp(np.minimum(Z95 * np.hypot(setting.unsure, SMOOTHER_SD), MOST_UNKNOWN))
        return {
            spec.name: (float(value), (float(value / wide), float(value * wide)))
            for spec, value, wide in zip(cls.parameters, setting, reach, strict=False)
        }


def _one_contact(t_s: FloatArray) -> np.ndarray:
    return np.asarray(np.arange(t_s.size) == 0)


def _delays_s(view: View, setting: Setting) -> tuple[FloatArray, FloatArray]:
    """Delay at each edge, and the share at rest of the cut-off; (m,)."""
    traces = view.averaged
    cut_off = cut_off_hz(traces.t_s, traces.xy_mm, setting, first_of_contact(traces.t_s))
    delay_s = np.asarray(traces.rows @ (1 / (2 * np.pi * cut_off)))
    return delay_s, 2 * np.pi * setting.fmin_hz * delay_s
