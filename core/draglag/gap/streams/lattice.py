"""The lattice of whole coordinates, where a calibration has turned or sheared it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from draglag.gap.streams.stamps import FINEST_MM, ROUNDED_MM, SHARE_WHOLE, SMALL, WHOLE, resolutions_mm
from draglag.recording import FloatArray, Run, TouchTrace

COMMON = 10  # times that a step between two events has to occur: of steps of any length none does. Derived
OF_DECIMALS = 10.0  # times: steps are then known to a tenth, of four to less than half of one. Derived
EXACTLY = 1e-3  # of the logarithm of a step: that of decimals, but for arithmetic. Derived
WIDER_THAN_A_PANEL = 2**32  # in units of ROUNDED_MM or more: 43 km. Derived
APART = 0.3  # sine of the angle between two directions of a lattice: no calibration shears a panel by more. Physical


def basis_of(touches: Sequence[TouchTrace]) -> FloatArray | None:
    """Steps of whole coordinates, mm, in columns (2, 2), the first one nearer to x; None where they are not whole."""
    steps_mm = resolutions_mm(list(touches))
    if not all(steps_mm):
        return _turned(touches, ROUNDED_MM)
    decimals_mm = min(steps_mm)
    if _is_decimal(decimals_mm):
        # A file's decimals may hide a panel's steps, which are longer by far where they show.
        turned = _turned(touches, 2 * decimals_mm)
        if turned is not None and min(lengths_mm(turned)) > OF_DECIMALS * decimals_mm:
            return turned
    return np.diag(steps_mm)


def _is_decimal(step_mm: float) -> bool:
    return bool(abs(np.log10(step_mm) - round(np.log10(step_mm))) < EXACTLY)


def lengths_mm(basis: FloatArray) -> tuple[float, float]:
    """Of both steps."""
    first, second = np.hypot(*basis).tolist()
    return first, second


def is_turned(basis: FloatArray) -> bool:
    """Whether steps lie across x or y by more than arithmetic."""
    return bool(abs(basis[0, 1]) > ROUNDED_MM or abs(basis[1, 0]) > ROUNDED_MM)


def _turned(touches: Sequence[TouchTrace], exact_mm: float) -> FloatArray | None:
    """Steps in any direction. exact_mm: within which displacements by the same steps lie."""
    steps_mm = np.concatenate([np.diff(np.column_stack([t.x_mm, t.y_mm]), axis=0) for t in touches])
    steps_mm = steps_mm[np.hypot(*steps_mm.T) > ROUNDED_MM]
    forward = (steps_mm[:, 0] > ROUNDED_MM) | ((np.abs(steps_mm[:, 0]) <= ROUNDED_MM) & (steps_mm[:, 1] > 0))
    steps_mm = np.where(forward[:, None], steps_mm, -steps_mm)
    units = np.round(steps_mm / exact_mm).astype(np.int64)
    _, first, which, count = np.unique(
        units[:, 0] * WIDER_THAN_A_PANEL + units[:, 1], return_index=True, return_inverse=True, return_counts=True
    )
    common = np.flatnonzero(count >= COMMON)
    pair = _shortest(steps_mm[first[common]])
    if pair is None:
        return None
    basis = np.array([steps_mm[which == common[k]].mean(axis=0) for k in pair]).T
    whole = steps_mm @ np.linalg.inv(basis).T
    small = np.abs(whole).max(axis=1) < SMALL + 0.5
    short, whole = steps_mm[small], whole[small]
    fits = np.abs(whole - np.round(whole)).max(axis=1) < WHOLE
    if not fits.any() or np.mean(fits) < SHARE_WHOLE:
        return None
    return np.asarray(np.linalg.lstsq(np.round(whole[fits]), short[fits], rcond=None)[0].T)


def _shortest(steps_mm: FloatArray) -> list[int] | None:
    """The shortest of steps (k, 2) and the shortest in another direction, the one nearer to x first."""
    length_mm = np.hypot(*steps_mm.T)
    length_mm = np.where(length_mm > FINEST_MM, length_mm, np.inf)
    if not np.isfinite(length_mm).any():
        return None
    first = int(np.argmin(length_mm))
    across = np.abs(steps_mm[:, 0] * steps_mm[first, 1] - steps_mm[:, 1] * steps_mm[first, 0])
    other = int(np.argmin(np.where(across > APART * length_mm * length_mm[first], length_mm, np.inf)))
    if other == first:
        return None
    return sorted((first, other), key=lambda k: -abs(steps_mm[k, 0]) / length_mm[k])


def rounded(touch: TouchTrace, basis: FloatArray) -> TouchTrace:
    """A trace in whole steps of a lattice."""
    x_mm, y_mm = basis @ np.round(np.linalg.inv(basis) @ np.array([touch.x_mm, touch.y_mm]))
    return replace(touch, x_mm=x_mm, y_mm=y_mm)


def along(run: Run, basis: FloatArray) -> Run:
    """The run with positions along the steps of a lattice, in mm: whole ones differ by whole steps' lengths."""
    return _moved(run, np.diag(lengths_mm(basis)) @ np.linalg.inv(basis))


def back(run: Run, basis: FloatArray) -> Run:
    """The run that ``along`` was given."""
    return _moved(run, basis @ np.diag(1 / np.array(lengths_mm(basis))))


def _moved(run: Run, by: FloatArray) -> Run:
    x_mm, y_mm = by @ np.array([run.touch.x_mm, run.touch.y_mm])
    return replace(run, touch=replace(run.touch, x_mm=x_mm, y_mm=y_mm))
