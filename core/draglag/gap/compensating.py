"""Recorded touch events compensated for all that a model holds: its law, and the effects that touch events show."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from draglag.errors import DataError
from draglag.exchange.streams import check_interval
from draglag.gap.correction import Correction, corrected_touch, merged
from draglag.messages import Message, message
from draglag.model.compensation import Compensated
from draglag.model.compensation import compensate as apply
from draglag.model.compensation import merged as together
from draglag.model.file import LatencyModel
from draglag.path.events import events_of_several, usable
from draglag.reading.limits import TIME_S
from draglag.reading.off_screen import MARGIN, off_screen
from draglag.recording import FloatArray, IntArray, Run, Screen, TouchTrace, empty_laser

NEAR_CORNER_MM = 1.0  # mm. No stylus stays so near to the corner of a screen; positions in m do. Physical


@dataclass(frozen=True)
class Origin:
    """What the events are called in sentences, and what to do where their times, positions or contacts are wrong."""

    name: str
    times: str
    positions: str
    contacts: str


IN_PYTHON = Origin(
    "these events",
    message("Give all times in seconds"),
    message("Give the positions in mm"),
    message("Give the contact of each event, as in dl.compensate(t_s, x_mm, y_mm, law, contact_id)"),
)


@dataclass(frozen=True)
class CompensatedEvents:
    """Events without lag, the effects they were corrected for, and warnings."""

    done: Compensated
    correction: Correction
    warnings: tuple[Message, ...]

    def noted(self) -> Compensated:
        """The events, warnings and corrections in their notes."""
        return replace(self.done, notes=tuple(filter(None, (*self.warnings, self.correction.words()))))


def compensate_events(
    t_s: FloatArray,
    x_mm: FloatArray,
    y_mm: FloatArray,
    model: LatencyModel,
    contact_id: ArrayLike | None = None,
    *,
    extrapolate: bool = False,
    origin: Origin = IN_PYTHON,
) -> CompensatedEvents:
    """Where the stylus was, given recorded touch events (n,), in s and mm, each contact by itself.

    contact_id: (n,) numbers or texts; None: all events are of one contact. Contacts of fewer than eight events stay
    NaN. Raises DataError where all are so short, and for times, positions or contacts that cannot be right.
    """
    if not t_s.shape == x_mm.shape == y_mm.shape or t_s.ndim != 1:
        raise DataError("times and positions differ in number", "Give one t, x and y for each event")

    def law(speed_mm_s: FloatArray) -> FloatArray:
        return model.latency_s(speed_mm_s, extrapolate=extrapolate)

    contact = _contacts(contact_id, t_s.size)
    warnings = _checked(t_s, x_mm, y_mm, model, origin)
    order = np.argsort(contact, kind="stable")
    parts: list[tuple[np.ndarray, Compensated]] = []
    corrections: list[Correction] = []
    trouble: DataError | None = None
    for which in np.split(order, np.flatnonzero(np.diff(contact[order])) + 1):
        recorded = (t_s[which], x_mm[which], y_mm[which])
        _check_contact(TouchTrace(*recorded), origin)
        shown_s, x_shown_mm, y_shown_mm, correction = corrected_touch(*recorded, model)
        try:
            parts.append((which, apply(shown_s, x_shown_mm, y_shown_mm, law, model.speed_range_mm_s, recorded)))
            corrections.append(correction)
        except DataError as error:
            trouble = trouble or error
    if trouble is not None and not parts:
        raise trouble
    return CompensatedEvents(together(t_s, parts), merged(corrections), warnings)


def _contacts(contact_id: ArrayLike | None, n: int) -> IntArray:
    """Equal numbers for equal contacts, (n,)."""
    if contact_id is None:
        return np.zeros(n, np.int64)
    given = np.asarray(contact_id)
    if given.shape != (n,):
        raise DataError("times and contacts differ in number", "Give one contact_id for each event")
    return np.asarray(np.unique(given.astype(str), return_inverse=True)[1], np.int64)


def _checked(
    t_s: FloatArray, x_mm: FloatArray, y_mm: FloatArray, model: LatencyModel, origin: Origin
) -> tuple[Message, ...]:
    """Warnings about positions off the model's screen. Raises DataError for times and positions in another unit."""
    if np.max(np.abs(t_s), initial=0.0, where=np.isfinite(t_s)) > TIME_S:
        raise DataError("t_s holds times that cannot be seconds", origin.times)
    known = np.isfinite(t_s) & np.isfinite(x_mm) & np.isfinite(y_mm)
    touch = TouchTrace(t_s[known], x_mm[known], y_mm[known])
    width_mm, height_mm = model.provenance.screen_width_mm or 0.0, model.provenance.screen_height_mm or 0.0
    near_mm = [max(NEAR_CORNER_MM, (1 + MARGIN) * 1e-3 * side_mm) for side_mm in (width_mm, height_mm)]
    reach_mm = [float(np.max(np.abs(values), initial=0.0)) for values in (touch.x_mm, touch.y_mm)]
    if touch.t_s.size and reach_mm[0] <= near_mm[0] and reach_mm[1] <= near_mm[1]:
        problem = message(
            "x_mm reaches {across:.3g} mm and y_mm {down:.3g} mm at most, nearer to the corner of the screen than any "
            "stylus stays",
            across=reach_mm[0],
            down=reach_mm[1],
        )
        raise DataError(problem, origin.positions)
    screen = Screen(model.provenance.screen, width_mm, height_mm, 1, 1)
    return tuple(off_screen(screen, [Run(origin.name, "free", 0.0, 0.0, touch, empty_laser())]))


def _check_contact(touch: TouchTrace, origin: Origin) -> None:
    """Raises DataError where events are too seldom for seconds, or no single stylus moves as they do."""
    check_interval(usable(touch).t_s, "t_s", origin.times)
    mixed = events_of_several(touch)
    if mixed:
        problem = message(
            "{n} of {of} events lie where no stylus can be between the events before and after: several contacts are "
            "mixed",
            n=mixed,
            of=touch.t_s.size,
        )
        raise DataError(problem, origin.contacts)
