"""Position errors repeat with the electrodes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from draglag.recording import FloatArray
from draglag.simulation.effects.base import Effect
from draglag.simulation.effects.in_fits import Z95, FittedTerm, Parameters, Theta, Undoing
from draglag.simulation.effects.parameter import Parameter
from draglag.simulation.effects.pitch_ripple.lattice import PITCHES_MM, Lattice, lattice_in
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.residual import LineGains, Signature, View

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.state import Term
    from draglag.gap.traces.run_data import RunData
    from draglag.simulation.effects.fitted_shape import FittedShape

PITCHES_TRIED = 8
PITCH_UNKNOWN = 0.015  # of a pitch: neighbouring ones of PITCHES_MM are 0.4 % apart, and edges hardly separate several


class Setting(NamedTuple):
    """rows: 1 if rows ripple, too; 0: columns alone."""

    pitch_mm: float
    rows: float = 0.0


@dataclass(frozen=True)
class PitchRipple(Effect):
    id: ClassVar[str] = "pitch_ripple"
    title: ClassVar[str] = "electrode ripple"
    meaning: ClassVar[str] = (
        "The position error is periodic in the electrode pitch: the error in each axis is a sine of "
        "the place along the other, as diamond electrodes make it."
    )
    in_detail: ClassVar[str] = (
        "x changes by A sin(2π y / p) and y by A sin(2π x / p), with x and y from the panel's top left "
        "corner. A fit takes any phase."
    )
    follows: ClassVar[str] = "x"
    where: ClassVar[str] = "along the panel, periodic in the electrode pitch"
    undone_in: ClassVar[str] = "touch"
    refitted_by: ClassVar[str] = "draglag.simulation.effects.pitch_ripple.refits"
    needs: ClassVar[str] = "width"
    identifiable_with: ClassVar[str] = "circles that travel across the whole width show it"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("amplitude_mm", "mm", -2.0, 2.0, 0.3),
        Parameter("pitch_mm", "mm", 1.0, 30.0, 5.0),
    )

    pitch_mm: float = 5.0

    def position(self, x_mm: FloatArray, y_mm: FloatArray, k: Kinematics) -> tuple[FloatArray, FloatArray]:
        wave = 2 * np.pi / self.pitch_mm
        x = x_mm + self.value * np.sin(wave * k.motion.y_mm)
        return x, y_mm + self.value * np.sin(wave * k.motion.x_mm)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        # Over a wide panel a pitch has to be right to half a percent. Those tried in earnest are the largest lines in
        # the spectrum over the edges' own x and y; those passed over have their share of the prior.
        pitches = PITCHES_MM
        if gains is not None:
            lines = np.zeros(pitches.size)
            for at_mm in (view.x_mm, view.y_mm):
                phase = 2 * np.pi * at_mm[:, None] / pitches
                lines += gains(np.stack([np.sin(phase), np.cos(phase)], axis=2).reshape(at_mm.size, -1))
            pitches = pitches[np.argsort(-lines)[:PITCHES_TRIED]]
        return [_ripple(view, Setting(float(p), rows)) for p in pitches for rows in (0.0, 1.0)]

    @classmethod
    def signature_at(cls, theta: Theta, view: View) -> Signature:
        return _ripple(view, Setting(*theta)) if theta else super().signature_at(theta, view)

    @classmethod
    def undoing(cls, term: Term, runs: tuple[RunData, ...]) -> tuple[Undoing | None, Term]:
        """Lattice that the traces show, if any; the term then starts at zero."""
        there = _undone_in(runs)
        lattice = there or lattice_in(tuple(data.as_shown or data for data in runs))
        if lattice is None or lattice is there:
            return lattice, term
        return lattice, replace(term, theta=Setting(lattice.pitch_mm, 1.0), sizes=(0.0,) * 4)

    @classmethod
    def whole_sizes(cls, term: Term, fit: Fit) -> FloatArray:
        lattice = _undone_in(fit.runs)
        return np.array(term.sizes) + (0.0 if lattice is None else lattice.sizes_mm[:, 1])

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        amplitude, reach = float(np.hypot(*found.sizes[:2])), Z95 * float(np.max(found.se[:2]))
        lattice = _undone_in(found.fit.runs)
        if lattice is not None:
            # Edges lie on one line across; what ripples with y alone is seen by the touch events only.
            amplitude = max(amplitude, float(np.hypot(*lattice.sizes_mm[2:, 1])))
        pitch = Setting(*found.term.theta).pitch_mm
        return {
            "amplitude_mm": (amplitude, (max(amplitude - reach, 0.0), amplitude + reach)),
            "pitch_mm": (pitch, (pitch * (1 - PITCH_UNKNOWN), pitch * (1 + PITCH_UNKNOWN))),
        }

    @classmethod
    def shape_in(cls, term: Term, fit: Fit) -> FittedShape | None:
        lattice = _undone_in(fit.runs)
        across = tuple(float(size) for size in cls.whole_sizes(term, fit))
        along = () if lattice is None else tuple(map(float, lattice.sizes_mm[:, 0]))
        return cls.of_shape(float(np.linalg.norm(across[:2])), tuple(term.theta), (*across, *along), 0.0)

    @classmethod
    def of_shape(cls, value: float, theta: Theta, sizes: Theta, about: float) -> FittedShape | None:
        from draglag.simulation.effects.pitch_ripple.fitted import FittedRipple

        return FittedRipple(value, tuple(theta), tuple(sizes), about)


def _ripple(view: View, setting: Setting) -> Signature:
    places = [view.averaged.x_mm, view.averaged.y_mm][: 2 if setting.rows else 1]
    phase = 2 * np.pi / setting.pitch_mm * np.column_stack(places)
    seen = view.averaged.rows @ np.column_stack([np.sin(phase), np.cos(phase)])
    columns = seen[:, [0, 2, 1, 3]] if setting.rows else seen  # sin and cos along x, then along y
    return Signature(offset=columns, theta=setting, share=1 / (2 * PITCHES_MM.size))


def _undone_in(runs: tuple[RunData, ...]) -> Lattice | None:
    return next((one for one in (runs[0].undone if runs else ()) if isinstance(one, Lattice)), None)
