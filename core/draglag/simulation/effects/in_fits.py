"""An effect in a fit: its term as numbers, words and simulated effect; its changes of traces and views.

Defaults suit one column, proportional to the size.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np
from scipy.sparse import csr_matrix

from draglag.recording import FloatArray

if TYPE_CHECKING:
    from draglag.gap.fitting.joint import Fit
    from draglag.gap.fitting.model import LawParameters
    from draglag.gap.fitting.state import Term
    from draglag.gap.traces.edges import Placed
    from draglag.gap.traces.run_data import RunData
    from draglag.simulation.effects.base import Parameter
    from draglag.simulation.effects.fitted_shape import FittedShape
    from draglag.simulation.residual import View

Theta = tuple[float, ...]
Parameters = dict[str, tuple[float, tuple[float, float]]]
"""Parameter → (value, 95 % interval)."""
Z95 = 1.96  # standard deviations to either end of a 95 % interval


@dataclass(frozen=True)
class FittedTerm:
    """A term of a converged fit.

    Attributes: own: its columns of the fit's design. sizes: (k,) with what was undone of it in the traces. se: (k,)
    their standard errors.
    """

    fit: Fit
    term: Term
    own: slice
    sizes: FloatArray
    se: FloatArray


@dataclass(frozen=True)
class UndoneTrace:
    """A run's events while effects are undone: t_s (n,), xy_mm (n, 2), noise_mm of one event.

    spread: (n, events shown) how much each event shown, noise included, moves each of the n; None: only itself.
    """

    t_s: FloatArray
    xy_mm: FloatArray
    noise_mm: float
    spread: csr_matrix | None = None


class Undoing(Protocol):
    """What is undone of an effect in the traces; equal if it does the same."""

    place: ClassVar[int]
    """Order of undoing, smallest first."""
    of_events: ClassVar[bool]
    """Whether the effect acts on events, not on the path: a simulated hand begins behind it."""

    def undo(self, trace: UndoneTrace, shown: RunData, first_s: float) -> UndoneTrace:
        """A run's events without the effect. shown: the run as shown; first_s: the session's first event, host time."""
        ...


class InFits:
    """The side of an effect that a fit sees."""

    parameters: ClassVar[tuple[Parameter, ...]]
    per_term: ClassVar[float] = 1.0
    """The first parameter over the size of its signature, for effects of one signature."""
    of_the_law: ClassVar[bool] = False
    """Whether a fit holds it in its law instead of as a term."""
    form_parameter: ClassVar[str] = ""
    """Parameter of a curve's form that is its size, if a form has it."""
    prior_sd: ClassVar[float] = float("inf")
    """Prior standard deviation of its sizes: small where columns hold only near a setting that moves from refit to
    refit."""
    unsure_share: ClassVar[float] = 0.0
    """Unknown share of what its columns vary by."""
    refitted_by: ClassVar[str] = ""
    """Module that begins its refits, where a plain one at its columns' best setting does not find it."""

    @classmethod
    def own_module(cls) -> ModuleType:
        """The module ``refitted_by``, imported late."""
        return import_module(cls.refitted_by)

    @classmethod
    def in_law(cls, law: LawParameters) -> bool:
        """Whether a law holds it."""
        return False

    @classmethod
    def law_parameters(cls, fit: Fit) -> Parameters:
        """Its parameters, as part of the fit's law."""
        return {}

    @classmethod
    def whole_sizes(cls, term: Term, fit: Fit) -> FloatArray:
        """A term's sizes (k,), with what traces or law already hold."""
        return np.array(term.sizes)

    @classmethod
    def size_sd(cls, found: FittedTerm) -> float:
        """Standard deviation of a term's first size, with what more edges do not reduce."""
        return float(found.se[0])

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        """A term in the effect's parameters; by default proportional to its first size."""
        value, reach = cls.per_term * found.sizes[0], abs(cls.per_term) * Z95 * cls.size_sd(found)
        return {cls.parameters[0].name: (float(value), (float(value - reach), float(value + reach)))}

    @classmethod
    def where_in(cls, fit: Fit) -> str | None:
        """Where it acts in a fit's session, in words; None: ``where``."""
        return None

    @classmethod
    def shape_in(cls, term: Term, fit: Fit) -> FittedShape | None:
        """A term as a simulated shape; None where the effect's parameters say all."""
        return None

    @classmethod
    def of_shape(cls, value: float, theta: Theta, sizes: Theta, about: float) -> FittedShape | None:
        """The same from the numbers of ``shape_in``, as in a model file."""
        return None

    @classmethod
    def undoing(cls, term: Term, runs: tuple[RunData, ...]) -> tuple[Undoing | None, Term]:
        """What to undo of it in the traces, if anything, and the remaining term."""
        return None, term

    @classmethod
    def undone_s(cls, term: Term, placed: Placed) -> FloatArray | float:
        """Delay of placed edges against traces with the term undone, (m,) s."""
        return 0.0

    @classmethod
    def speed_delay(cls, theta: Theta) -> tuple[float, float] | None:
        """(which, delay_s) of the law's speed, a ``SpeedDelay`` of ``gap.traces.law_speed``; None: the edge's own."""
        return None

    @classmethod
    def view_with(cls, theta: Theta, view: View) -> View:
        """The edges as seen with the effect at its setting."""
        return view

    @classmethod
    def log_prior_of(cls, theta: Theta) -> float:
        """Log prior of a setting found by a refit, where its columns do not have it."""
        return 0.0

    @classmethod
    def theta_at(cls, theta: Theta, sizes: Theta) -> Theta:
        """The setting after a step to these sizes, if it follows them."""
        return theta
