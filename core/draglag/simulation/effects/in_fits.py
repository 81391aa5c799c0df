"""What fits need of an effect; defaults suit one column, proportional to the size."""

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
    from draglag.simulation.effects.fitted_shape import FittedShape
    from draglag.simulation.effects.parameter import Parameter
    from draglag.simulation.residual import View

Theta = tuple[float, ...]
Parameters = dict[str, tuple[float, tuple[float, float]]]
"""Parameter → (value, 95 % interval)."""
Z95 = 1.96  # standard deviations to either end of a 95 % interval


@dataclass(frozen=True)
class FittedTerm:
    """A term of a converged fit.

    own: its columns of the design. sizes: (k,) with what is undone in the traces. se: (k,) standard errors.
    """

    fit: Fit
    term: Term
    own: slice
    sizes: FloatArray
    se: FloatArray


@dataclass(frozen=True)
class UndoneTrace:
    """A run's events (n,), (n, 2) with effects undone.

    noise_mm: of one event. spread: (n, events shown) weights of the events shown; None: identity.
    """

    t_s: FloatArray
    xy_mm: FloatArray
    noise_mm: float
    spread: csr_matrix | None = None


class Undoing(Protocol):
    """Undoing of an effect in traces; equal if it does the same."""

    place: ClassVar[int]
    """Order of undoing, smallest first."""
    of_events: ClassVar[bool]
    """Whether the effect acts on events, not on the path: a simulated hand begins behind it."""

    def undo(self, trace: UndoneTrace, shown: RunData, first_s: float) -> UndoneTrace:
        """Events without the effect. first_s: the session's first event, host clock."""
        ...


class InFits:
    """Hooks of an effect in fits."""

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
        """Whether the law holds it."""
        return False

    @classmethod
    def law_parameters(cls, fit: Fit) -> Parameters:
        """Its parameters in the fit's law."""
        return {}

    @classmethod
    def whole_sizes(cls, term: Term, fit: Fit) -> FloatArray:
        """Sizes (k,) with what traces or law already hold."""
        return np.array(term.sizes)

    @classmethod
    def unsure_mm(cls, term: Term, placed: Placed) -> FloatArray | float:
        """Standard deviation of edges (m,) whose state the term does not know."""
        return 0.0

    @classmethod
    def size_sd(cls, found: FittedTerm) -> float:
        """Standard deviation of the first size, with what more edges do not reduce."""
        return float(found.se[0])

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        """Parameters of a fitted term."""
        value, reach = cls.per_term * found.sizes[0], abs(cls.per_term) * Z95 * cls.size_sd(found)
        return {cls.parameters[0].name: (float(value), (float(value - reach), float(value + reach)))}

    @classmethod
    def where_in(cls, fit: Fit) -> str | None:
        """Where it acts in the session, in words; None: ``where``."""
        return None

    @classmethod
    def shape_in(cls, term: Term, fit: Fit) -> FittedShape | None:
        """Simulated shape of a term; None if the parameters suffice."""
        return None

    @classmethod
    def of_shape(cls, value: float, theta: Theta, sizes: Theta, about: float) -> FittedShape | None:
        """Shape from its numbers in a model file."""
        return None

    @classmethod
    def undoing(cls, term: Term, runs: tuple[RunData, ...]) -> tuple[Undoing | None, Term]:
        """What to undo in the traces, if anything, and the remaining term."""
        return None, term

    @classmethod
    def undone_s(cls, term: Term, placed: Placed) -> FloatArray | float:
        """Delay of placed edges relative to traces with the term undone, (m,)."""
        return 0.0

    @classmethod
    def speed_delay(cls, theta: Theta) -> tuple[float, float] | None:
        """``SpeedDelay`` (``gap.traces.law_speed``) of the law's speed; None: the edge's own."""
        return None

    @classmethod
    def view_with(cls, theta: Theta, view: View) -> View:
        """View with the effect at its setting."""
        return view

    @classmethod
    def log_prior_of(cls, theta: Theta) -> float:
        """Log prior of a refitted setting, if not in its columns."""
        return 0.0

    @classmethod
    def theta_at(cls, theta: Theta, sizes: Theta) -> Theta:
        """Setting after a step to these sizes."""
        return theta
