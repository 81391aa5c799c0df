"""A fitted model in the forward simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from draglag.errors import DataError
from draglag.gap.fitting.joint import Fit, effects_in_law
from draglag.gap.fitting.law_form import FlexibleLaw
from draglag.gap.fitting.parameters import parameters_of
from draglag.messages import message
from draglag.recording import Beam, Session
from draglag.simulation.effects import EFFECTS, Effect, effect_class
from draglag.simulation.law import LatencyLaw
from draglag.simulation.rig import Rig

# Speeds at which a law of its own form is tabulated: in between it is true to 3 µs; slower, a stylus rests. Derived
TABLE, SLOWEST_MM_S = 8000, 0.01


def named_effects(fit: Fit) -> dict[str, dict[str, float]]:
    """Id → parameters of a fit's effects."""
    ids = [*effects_in_law(fit), *(term.effect for term in fit.terms)]
    return {name: {k: value for k, (value, _) in parameters_of(name, fit).items()} for name in ids}


def effects_of_fit(fit: Fit, named: Mapping[str, Mapping[str, float]] | None = None) -> tuple[Effect, ...]:
    """Simulated effects, without those that measured streams hold already."""
    named = named_effects(fit) if named is None else named
    out: list[Effect] = []
    for name, numbers in named.items():
        home = effect_class(name)
        if home.in_measured_streams:
            continue
        term = next((t for t in fit.terms if t.effect == name), None)
        shape = None if term is None else home.shape_in(term, fit)
        out.append(made(name, numbers) if shape is None else shape)
    return tuple(out)


def made(name: str, numbers: Mapping[str, float]) -> Effect:
    """Effect of these numbers; missing ones typical, others clipped."""
    cls = EFFECTS[name]
    return cls(*(min(max(numbers.get(p.name, p.typical), p.lower), p.upper) for p in cls.parameters))


def held_s(effects: Sequence[Effect]) -> float:
    """Delay of stamps in a law fitted to repaired stamps."""
    return float(sum(effect.stamped_late_s() for effect in effects))


@dataclass(frozen=True)
class LawOfOwnForm(LatencyLaw):
    """Fitted law shifted to the asymptote a7_ms."""

    fitted: FlexibleLaw

    def latency_s(self, speed_mm_s: ArrayLike) -> NDArray[np.float64]:
        speed = np.asarray(speed_mm_s, float)
        late_s = self._looked_up(speed) if speed.size > TABLE else self.fitted(speed)
        return np.asarray(late_s + 1e-3 * self.a7_ms - self.fitted.a7_s)

    def _looked_up(self, speed_mm_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """At the many speeds of a run, from a table."""
        fast_mm_s = np.maximum(speed_mm_s, SLOWEST_MM_S)
        table = np.geomspace(SLOWEST_MM_S, max(float(fast_mm_s.max()), 2 * SLOWEST_MM_S), TABLE)
        return np.interp(np.log(fast_mm_s), np.log(table), self.fitted(table))


def rig_of(session: Session, fit: Fit, effects: tuple[Effect, ...]) -> Rig:
    """Rig of a fit; only position noise is random."""
    law = fit.law
    # Late stamps make latency read short: what the clock is blamed for is the law's again.
    asymptote_ms = 1e3 * (law.a7_s + sum(effect.value for effect in effects if effect.laser_late))
    asymptote_ms -= 1e3 * held_s(effects)
    slope, intercept = fit.geometry.slope, fit.geometry.intercept_mm
    # The fit knows the beam in the screen's coordinates, the simulation in the world's.
    for effect in effects:
        intercept = effect.true_intercept_mm(intercept, slope, session.screen)
    noise = float(np.median([data.noise_mm for data in fit.runs]))
    numbers = 1e3 * law.a1_s, law.a2_s_mm, 1e3 * law.a4_s, law.a5_s_mm, asymptote_ms
    return Rig(
        session.screen,
        session.stylus,
        LawOfOwnForm(*numbers, law) if isinstance(law, FlexibleLaw) else LatencyLaw(*numbers),
        Beam(slope, intercept),
        noise_mm=noise,
        noise_slow_share=0.0,
        run_latency_sd_s=0.0,
        run_offset_sd_mm=0.0,
        contact_loss_per_s=0.0,
        sensor_response_s=0.0,
        laser_clock_offset_s=0.0,
        laser_clock_ppm=0.0,
        resolution_mm=0.0,
        scan_jitter_s=0.0,
    )


def rig_with_law(
    rig: Rig, form: str, parameters: Mapping[str, float], effects: Sequence[Effect] = ()
) -> tuple[Rig, Effect | None]:
    """Rig with a model's law and tap delay, and the effect of a parameter of its form, if any.

    Raises DataError for a form that cannot be simulated.
    """
    zero = dict.fromkeys(("a1_ms", "a2_s_per_mm", "a4_ms", "a5_s_per_mm", "a7_ms"), 0.0)
    homes = {home.form_parameter: home for home in EFFECTS.values() if home.form_parameter}
    own = {name: value for name, value in parameters.items() if name not in homes}
    if not own.keys() <= zero.keys():
        raise DataError(
            message("a law of the form {form} cannot be simulated", form=form),
            "Save a model with --form double_exponential",
        )
    known = ((homes[name], value) for name, value in parameters.items() if name in homes and value)
    effect = next((made(home.id, {home.parameters[0].name: value}) for home, value in known), None)
    law = LatencyLaw(**{**zero, **own})
    law = replace(law, a7_ms=law.a7_ms - 1e3 * held_s(effects))
    later_s = 1e-3 * (law.a7_ms - rig.law.a7_ms)
    touch_s, release_s = max(rig.tap_touch_s + later_s, 0.0), max(rig.tap_release_s + later_s, 0.0)
    return replace(rig, law=law, tap_touch_s=touch_s, tap_release_s=release_s), effect
