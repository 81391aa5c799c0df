"""The panel's coordinates are bent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.in_fits import Z95, FittedTerm, Parameters, Theta
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.state import Term
    from draglag.simulation.effects.fitted_shape import FittedShape

CYCLES = np.arange(0.5, 2.01, 0.125)  # of a sine over the panel's width
DEGREES = (2, 6)  # of polynomials: the class's own bend, and any smooth one
SHARE_OF_WAVES = 0.3  # of the prior probability
WITHIN = 3.84  # of the deviance of the best: not excluded at 95 %
ELSEWHERE = 0.2  # of a bend: runs show it on the beam's line only; generated ones were up to 0.17 larger elsewhere
BEND_UNKNOWN = 0.3  # of a polynomial's amplitude, either way


class Setting(NamedTuple):
    """cycles: of a wave over the panel's width; 0: a polynomial of this degree."""

    cycles: float = 0.0
    degree: float = max(DEGREES)


@dataclass(frozen=True)
class SpatialWarp(Effect):
    id: ClassVar[str] = "spatial_warp"
    meaning: ClassVar[str] = (
        "Reported heights are bent along the panel by a smooth quadratic: this much at its left and "
        "right edges, half of it the other way in the middle."
    )
    in_detail: ClassVar[str] = (
        "y changes by A (1.5 u² − 0.5), u from −1 at the left edge to 1 at the right: down the screen at both "
        "edges for a positive A. A fit takes any bend or wave along x and reports half of its range, without "
        "a sign."
    )
    follows: ClassVar[str] = "x"
    where: ClassVar[str] = "along x, smoothly"
    separated_by: ClassVar[str] = "a second beam height: a bent panel bends there too, a curved beam moves along"
    undone_in: ClassVar[str] = "touch"
    needs: ClassVar[str] = "width"
    identifiable_with: ClassVar[str] = "circles that travel across the whole width show it"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("amplitude_mm", "mm", -5.0, 5.0, 0.6),)

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        u = 2 * k.motion.x_mm / k.width_mm - 1
        return x_mm, y_mm + self.value * (1.5 * u**2 - 0.5)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        bends = [cls.signature_at(Setting(0.0, float(degree)), view) for degree in DEGREES]
        return [*bends, *(cls.signature_at((float(k),), view) for k in CYCLES)]

    @classmethod
    def signature_at(cls, theta: Theta, view: View) -> Signature:
        setting, x = Setting(*theta), view.panel_x
        if setting.cycles > 0:
            return Signature(offset=_wave(setting, x), theta=theta, share=SHARE_OF_WAVES / CYCLES.size)
        powers = np.column_stack([x**k for k in range(2, int(setting.degree) + 1)])
        powers[:, 0] -= x.mean()
        return Signature(offset=powers, theta=setting, share=(1 - SHARE_OF_WAVES) / len(DEGREES))

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        """Amplitude over the panel."""
        sizes, x = found.sizes, found.fit.view.panel_x
        if Setting(*found.term.theta).cycles > 0:
            amplitude, reach = float(np.hypot(*sizes[:2])), Z95 * float(np.max(found.se[:2]))
        else:
            shape = np.column_stack([x**k for k in range(2, 2 + sizes.size)]) @ sizes
            amplitude = 0.5 * float(np.ptp(shape - np.polyval(np.polyfit(x, shape, 1), x)))
            reach = BEND_UNKNOWN * amplitude
        ends = np.array([(max(amplitude - reach, 0.0), amplitude + reach), *cls._amplitudes_alike(found)])
        low, high = float(ends[:, 0].min() / (1 + ELSEWHERE)), float(ends[:, 1].max() * (1 + ELSEWHERE))
        return {cls.parameters[0].name: (amplitude, (low, high))}

    @classmethod
    def _amplitudes_alike(cls, found: FittedTerm) -> list[tuple[float, float]]:
        """Amplitude intervals of all waves that the edges do not exclude; runs on a part of the panel hardly separate
        them."""
        from draglag.gap.constants import LEAST_PRECISION

        fit, own = found.fit, found.own
        waves = [cls.signature_at((float(cycles),), fit.view).columns(fit.view) for cycles in CYCLES]
        others = np.delete(fit.design, own, axis=1)
        target = fit.residual_mm + fit.design[:, own] @ found.sizes
        white = fit.white.apply(np.column_stack([others, *waves, target]))
        prior = np.diag(np.append(np.delete(fit.prior, own), [LEAST_PRECISION] * 2))
        p, alike = others.shape[1], []
        for k in range(CYCLES.size):
            a = np.column_stack([white[:, :p], white[:, p + 2 * k : p + 2 * k + 2]])
            spread = np.linalg.pinv(a.T @ a + prior, hermitian=True)
            moment = a.T @ white[:, -1]
            amplitude, reach = np.hypot(*(spread @ moment)[-2:]), Z95 * np.sqrt(np.diag(spread)[-2:].max())
            alike.append((float(moment @ spread @ moment), float(amplitude - reach), float(amplitude + reach)))
        best = max(gain for gain, _, _ in alike)
        return [(max(low, 0.0), high) for gain, low, high in alike if gain > best - WITHIN]

    @classmethod
    def shape_in(cls, term: Term, fit: Fit) -> FittedShape | None:
        sizes = tuple(float(size) for size in cls.whole_sizes(term, fit))
        about = float((2 * fit.placed.xy_mm[:, 0] / fit.width_mm - 1).mean())
        return cls.of_shape(float(np.linalg.norm(sizes[:2])), tuple(term.theta), sizes, about)

    @classmethod
    def of_shape(cls, value: float, theta: Theta, sizes: Theta, about: float) -> FittedShape | None:
        from draglag.simulation.effects.spatial_warp.fitted import FittedBend

        return FittedBend(value, tuple(theta), tuple(sizes), about)


def _wave(setting: Setting, x: FloatArray) -> FloatArray:
    """Sine and cosine at x (m,), −1 … +1; (m, 2)."""
    return np.column_stack([f(setting.cycles * np.pi * x) for f in (np.sin, np.cos)])
