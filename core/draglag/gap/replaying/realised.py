"""A fitted model as the forward simulation has it: a rig with the fitted law and beam, and effects of its classes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from draglag.errors import DataError
from draglag.gap.fitting.joint import Fit
from draglag.gap.fitting.parameters import parameters_of, whole_sizes
from draglag.gap.fitting.state import SHOWN, Term
from draglag.recording import Beam, FloatArray, Session
from draglag.simulation.effects import EFFECTS, Effect, Parameter
from draglag.simulation.effects.second_filter_mode import within
from draglag.simulation.effects.smoothing_shrink import behind
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.law import LatencyLaw
from draglag.simulation.rig import Rig

# Their classes have one shape; a fit finds the shape too.
OF_FREE_SHAPE = ("spatial_warp", "pitch_ripple")
# Rates with which events come are random where these act; what the streams lost is lost in the measured trace already.
IN_THE_TRACE = ("loss_of_contact", "frame_drop", "laser_bounce")


@dataclass(frozen=True)
class FittedShape(Effect):
    """A displacement in the very shape that a fit found, a low-pass that looks back only, or a second filter's times.

    ``value``: its amplitude, mm (a filter: s).

    sizes: of the shape's parts across the beam; a ripple's then along it, where known. about: the panel coordinate
    (−1 … +1) about which the polynomial's square has no mean.
    """

    id: ClassVar[str] = "fitted_shape"
    meaning: ClassVar[str] = "A displacement or latency in the shape that a fit found."
    parameters: ClassVar[tuple[Parameter, ...]] = ()

    effect: str = "spatial_warp"
    theta: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()
    about: float = 0.0

    def __post_init__(self) -> None:
        """A fitted shape has no bounds of its own."""

    def numbers(self) -> dict[str, float]:
        return {"amplitude_mm": float(self.value)}

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        if self.effect != "second_filter_mode":
            return latency_s
        if self.theta[1] >= 2:
            at_s = k.session_s + (latency_s if self.theta[1] == SHOWN else 0.0)
            return np.asarray(latency_s + self.sizes[0] * within(self.theta[2:], at_s))
        return latency_s + self.sizes[0] * (np.abs(k.tangential_mm_s2) > self.theta[0])

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        if self.effect == "second_filter_mode":
            return x_mm, y_mm
        if self.effect == "pitch_ripple":
            waves = [2 * np.pi * at / self.theta[0] for at in (k.motion.x_mm, k.motion.y_mm)]
            shape = [f(wave) for wave in waves for f in (np.sin, np.cos)]
            x_mm = x_mm + sum((size * part for size, part in zip(self.sizes[4:], shape, strict=False)), 0.0)
        elif self.effect == "smoothing_shrink":
            return behind(x_mm, self.value, k.step_s), behind(y_mm, self.value, k.step_s)
        else:
            u = 2 * k.motion.x_mm / k.width_mm - 1
            if self.theta and self.theta[0] > 0:
                shape = [np.sin(self.theta[0] * np.pi * u), np.cos(self.theta[0] * np.pi * u)]
            else:
                shape = [u**k for k in range(2, 2 + len(self.sizes))]
                shape[0] = shape[0] - self.about
        own = self.sizes[: len(shape)] if self.effect == "pitch_ripple" else self.sizes  # a ripple's x only, or both
        for size, part in zip(own, shape[: len(own)], strict=True):
            y_mm = y_mm + size * part
        return x_mm, y_mm


def named_effects(fit: Fit) -> dict[str, dict[str, float]]:
    """Effects of a fit's terms and law under their own names: id → parameters."""
    ids = [*(["low_speed_plateau"] if fit.law.plateau_mm_s > 0 else []), *(term.effect for term in fit.terms)]
    return {name: {k: value for k, (value, _) in parameters_of(name, fit).items()} for name in ids}


def effects_of_fit(fit: Fit, named: Mapping[str, Mapping[str, float]] | None = None) -> tuple[Effect, ...]:
    """Effects as the simulation has them; a size beyond the bounds of its class is held at the bound."""
    named = named_effects(fit) if named is None else named
    out: list[Effect] = []
    for name, numbers in named.items():
        if name in IN_THE_TRACE:
            continue
        term = next((t for t in fit.terms if t.effect == name), None)
        if term is not None and has_free_shape(term):
            out.append(fitted_shape(term, fit))
            continue
        out.append(made(name, numbers))
    return tuple(out)


def has_free_shape(term: Term) -> bool:
    """Whether its numbers alone do not say what the term does: a fitted shape, a filter that follows acceleration."""
    if term.effect == "smoothing_shrink":
        return len(term.theta) == 1  # an even one is the class's own
    return term.effect in OF_FREE_SHAPE or (term.effect == "second_filter_mode" and term.theta[1:2] > (0.0,))


def fitted_shape(term: Term, fit: Fit) -> FittedShape:
    """The term as a displacement of its own shape."""
    panel_x = 2 * fit.placed.xy_mm[:, 0] / fit.width_mm - 1
    sizes = tuple(float(size) for size in whole_sizes(term, fit))
    lattice = fit.runs[0].lattice
    along = () if lattice is None or term.effect != "pitch_ripple" else tuple(map(float, lattice.sizes_mm[:, 0]))
    amplitude = float(np.linalg.norm(sizes[:2]))
    if term.effect == "smoothing_shrink":
        amplitude = float(np.sqrt(sizes[0]))
    about = 0.0 if term.effect == "second_filter_mode" else float(panel_x.mean())
    return FittedShape(amplitude, term.effect, term.theta, (*sizes, *along), about)


def made(name: str, numbers: Mapping[str, float]) -> Effect:
    """An effect of the library from its numbers; what is not given is typical, what is out of bounds is held."""
    cls = EFFECTS[name]
    return cls(*(min(max(numbers.get(p.name, p.typical), p.lower), p.upper) for p in cls.parameters))


def held_s(effects: Sequence[Effect]) -> float:
    """By how much ticks and coarse clocks stamp events late, s: a fit to the repaired stamps has that in its law."""
    late = {
        "sample_hold": lambda value: 0.5 / value,
        "timestamp_quantisation": lambda value: 0.5 * value,
        "poll_grid": lambda value: 0.5 * value,
    }
    return float(sum(late[effect.id](effect.value) for effect in effects if effect.id in late))


def rig_of(session: Session, fit: Fit, effects: tuple[Effect, ...]) -> Rig:
    """The rig that the fit describes: its law, its beam, the session's position noise; nothing else is random."""
    size = {effect.id: effect.value for effect in effects}
    law = fit.law
    # Late stamps make latency read short: what the clock is blamed for is the law's again.
    asymptote_ms = 1e3 * (law.a7_s + size.get("clock_offset", 0.0))
    asymptote_ms -= 1e3 * held_s(effects)
    slope, intercept = fit.geometry.slope, fit.geometry.intercept_mm
    share = size.get("scale_error", 0.0)
    # The fit knows the beam in the screen's coordinates, the simulation in the world's.
    middle = 0.5 * (session.screen.height_mm - slope * session.screen.width_mm)
    intercept = (intercept + share * middle) / (1 + share)
    noise = float(np.median([data.noise_mm for data in fit.runs]))
    return Rig(
        session.screen,
        session.stylus,
        LatencyLaw(1e3 * law.a1_s, law.a2_s_mm, 1e3 * law.a4_s, law.a5_s_mm, asymptote_ms),
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
    """A rig with the law of a model instead of its own, and the plateau that a form with one asks for. Its taps are as
    much later than the rig's as the law's asymptote is.

    Args:
        effects: of the same model: by how much they stamp late is not the law's.

    Raises DataError for a form the simulation does not have.
    """
    zero = dict.fromkeys(("a1_ms", "a2_s_per_mm", "a4_ms", "a5_s_per_mm", "a7_ms"), 0.0)
    plateau = parameters.get("plateau_mm_s")
    own = {name: value for name, value in parameters.items() if name != "plateau_mm_s"}
    if not own.keys() <= zero.keys():
        raise DataError(f"a law of the form {form} cannot be simulated", "Save a model with --form double_exponential")
    effect = made("low_speed_plateau", {"speed_mm_s": plateau}) if plateau else None
    law = LatencyLaw(**{**zero, **own})
    law = replace(law, a7_ms=law.a7_ms - 1e3 * held_s(effects))
    later_s = 1e-3 * (law.a7_ms - rig.law.a7_ms)
    touch_s, release_s = max(rig.tap_touch_s + later_s, 0.0), max(rig.tap_release_s + later_s, 0.0)
    return replace(rig, law=law, tap_touch_s=touch_s, tap_release_s=release_s), effect
