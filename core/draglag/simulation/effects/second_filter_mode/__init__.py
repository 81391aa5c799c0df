"""The digitiser switches to another filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from draglag.messages import message
from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.in_fits import FittedTerm, Parameters, Theta, Undoing
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.effects.second_filter_mode.lateness import Lateness
from draglag.simulation.effects.second_filter_mode.setting import By, Setting
from draglag.simulation.effects.second_filter_mode.skips import threshold_of_change
from draglag.simulation.effects.second_filter_mode.unsure import state_variance
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View, column

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.state import Term
    from draglag.gap.traces.edges import Placed
    from draglag.gap.traces.run_data import RunData
    from draglag.simulation.effects.fitted_shape import FittedShape

THRESHOLDS = {By.SPEED: "threshold_mm_s", By.ACCELERATION: "threshold_mm_s2"}
RUNS_DIFFER_S = 7e-4
"""s. Runs of sound panels differ by about this (fact sheet on the gap): a smaller step may be one of those."""
SETTINGS = 16  # thresholds whose columns are compared. Derived: a twentieth of the edges lies between two, alike in all
FEWEST = 0.12  # of the edges, which have to lie on either side of a threshold. Judgement
LOWEST, HIGHEST = 0.8, 1.25  # of a threshold: edges lie at speeds that far apart
SMOOTHED = 1.4  # a change of speed reads less or more as a panel smooths it
SWITCH_UNKNOWN = 0.01  # of a lateness: when exactly, between two events, it comes and goes
SKIP_UNKNOWN = 0.03  # of a lateness: the touch events' rate in time, their speed next to a skip


@dataclass(frozen=True)
class SecondFilterMode(Effect):
    id: ClassVar[str] = "second_filter_mode"
    meaning: ClassVar[str] = "Above a switching speed the digitiser uses a second filter, slower by a constant."
    in_detail: ClassVar[str] = (
        "The speed is that of the stylus at the reported position; it switches at once and without hysteresis."
    )
    follows: ClassVar[str] = "speed"
    where: ClassVar[str] = "above a threshold of speed"
    undone_in: ClassVar[str] = "law of speed"
    refitted_by: ClassVar[str] = "draglag.simulation.effects.second_filter_mode.refits"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("extra_s", "s", -0.05, 0.05, 0.006, sound=RUNS_DIFFER_S),
        Parameter("threshold_mm_s", "mm/s", 10.0, 2000.0, 300.0),
    )

    threshold_mm_s: float = 300.0

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + self.value * (k.speed_mm_s > self.threshold_mm_s)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # A stronger filter above some speed, or while the stylus speeds up or slows down.
        out = []
        for by, values in ((By.SPEED, view.speed), (By.ACCELERATION, np.abs(view.accel))):
            limits = np.quantile(values, np.linspace(FEWEST, 1 - FEWEST, SETTINGS))
            out += [_mode(view, Setting(float(limit), by)) for limit in limits]
        return out

    @classmethod
    def signature_at(cls, theta: Theta, view: View) -> Signature:
        setting = Setting.of(theta)
        return super().signature_at(theta, view) if setting is None else _mode(view, setting)

    @classmethod
    def undoing(cls, term: Term, runs: tuple[RunData, ...]) -> tuple[Undoing | None, Term]:
        setting = Setting.of(term.theta)
        if setting is None or not setting.shown:
            return None, term
        return Lateness(setting.above, setting.times_s), term

    @classmethod
    def undone_s(cls, term: Term, placed: Placed) -> FloatArray | float:
        setting = Setting.of(term.theta)
        if setting is None or not setting.shown:
            return 0.0
        return np.asarray(setting.above * setting.within(placed.since_start_s, placed.latency_s))

    @classmethod
    def whole_sizes(cls, term: Term, fit: Fit) -> FloatArray:
        setting = Setting.of(term.theta)
        return np.array(term.sizes) + (setting.above if setting is not None and setting.shown else 0.0)

    @classmethod
    def unsure_mm(cls, term: Term, placed: Placed) -> FloatArray | float:
        """Of a position that lies anywhere between both filters', where it is unsure which is used."""
        setting = Setting.of(term.theta)
        if setting is None:
            return 0.0
        size_s = setting.above if setting.shown else term.sizes[0]
        apart_mm = np.abs(size_s * placed.v_mm_s[:, 1] * placed.stretch)
        return np.asarray(apart_mm * np.sqrt(state_variance(placed, setting, size_s)))

    @classmethod
    def size_sd(cls, found: FittedTerm) -> float:
        setting, se = Setting.of(found.term.theta), found.se[0]
        if setting is None or not setting.shown:
            return float(se)
        # Known from the touch events' skips too; few edges may lie in its stretches, or none.
        skips_s = SKIP_UNKNOWN * setting.above
        se = skips_s if se == 0 else 1 / np.hypot(1 / se, 1 / skips_s)
        return float(np.hypot(se, SWITCH_UNKNOWN * setting.above))

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        out, setting = super().parameters_in(found), Setting.of(found.term.theta)
        if setting is not None and not setting.timed:
            name = THRESHOLDS[setting.by]
            out[name] = (setting.above, (LOWEST * setting.above, HIGHEST * setting.above))
        change = _threshold_of_change(found.fit)
        if change is not None:
            out[THRESHOLDS[By.ACCELERATION]] = (change, (change / SMOOTHED, change * SMOOTHED))
        return out

    @classmethod
    def where_in(cls, fit: Fit) -> str | None:
        setting = next((Setting.of(term.theta) for term in fit.terms if term.effect == cls.id), None)
        if setting is None or not setting.times_s:
            return None
        change, times = _threshold_of_change(fit), setting.times_s
        seconds = sum(times[1::2]) - sum(times[::2])
        return message(
            "in {n} stretches of time, {seconds:.0f} s in all"
            if change is None
            else "in {n} stretches of time, {seconds:.0f} s in all, as a rule where the speed changes by more than "
            "{change:.0f} mm/s²",
            n=len(times) // 2,
            seconds=seconds,
            change=change,
        )

    @classmethod
    def shape_in(cls, term: Term, fit: Fit) -> FittedShape | None:
        setting = Setting.of(term.theta)
        if setting is None or setting.by is By.SPEED:
            return None
        sizes = tuple(float(size) for size in cls.whole_sizes(term, fit))
        return cls.of_shape(float(np.linalg.norm(sizes[:2])), term.theta, sizes, 0.0)

    @classmethod
    def of_shape(cls, value: float, theta: Theta, sizes: Theta, about: float) -> FittedShape | None:
        from draglag.simulation.effects.second_filter_mode.fitted import FittedMode

        return FittedMode(value, tuple(theta), tuple(sizes), about)

    @classmethod
    def curve_extra_s(cls, speed_mm_s: FloatArray, parameters: Mapping[str, float]) -> FloatArray | float:
        extra_s, above_mm_s = (parameters.get(spec.name) for spec in cls.parameters)
        return 0.0 if extra_s is None or above_mm_s is None else np.where(speed_mm_s > above_mm_s, extra_s, 0.0)


def _mode(view: View, setting: Setting) -> Signature:
    if setting.timed:
        on = setting.within(view.since_start_s, view.latency_s)
    else:
        on = (np.abs(view.accel) if setting.by is By.ACCELERATION else view.speed) > setting.above
    return Signature(latency=column(on.astype(float)), theta=setting.theta)


def _threshold_of_change(fit: Fit) -> float | None:
    """Acceleration threshold of a filter that events show; None if it follows none."""
    settings = (Setting.of(term.theta) for term in fit.terms if term.effect == SecondFilterMode.id)
    times = next((setting.times_s for setting in settings if setting is not None and setting.shown), None)
    return None if times is None else threshold_of_change(fit.runs, times)
