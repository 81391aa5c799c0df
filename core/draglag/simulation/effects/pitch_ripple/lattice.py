"""A ripple found and undone in touch events: at drag speeds it is quicker than any hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from draglag.path.motion import best_half_width_s
from draglag.path.savgol import smoothed, weights
from draglag.recording import FloatArray
from draglag.simulation.effects.in_fits import UndoneTrace

if TYPE_CHECKING:
    from draglag.gap.traces.run_data import RunData

PITCHES_MM = np.geomspace(3.0, 10.0, 300)

WINDOW, DEGREE = 17, 3  # events of the smooth path
BENDS = 5  # its degree for a place: a quick circle is half a turn in a window
RUNS_SEARCHED = 4  # runs that are enough to find the pitch
MANY = 2500  # events of each that are enough for a first search
USUAL_MM_S = 300.0  # quicker than a hand's own unevenness, slow enough for several events a pitch
GRID_MM, STEP_BINS = 0.2, 400  # of a first search: small compared with any pitch and with the events' spacing
STANDS_OUT = 12.0  # robust standard deviations of what other pitches explain; chance alone reaches 5
FINER = tuple(reach * np.linspace(-1, 1, 9) for reach in (0.004, 0.001, 3e-4, 1e-4, 3e-5))  # of the pitch, by rounds
SETTLING, INVERSE = 2, 6  # rounds


@dataclass(frozen=True, eq=False)
class Lattice:
    """sizes_mm (4, 2): of sin and cos along x, then along y; displacements in x and in y."""

    pitch_mm: float
    sizes_mm: FloatArray

    place: ClassVar[int] = 1
    of_events: ClassVar[bool] = False

    def undo(self, trace: UndoneTrace, shown: RunData, first_s: float) -> UndoneTrace:
        """Events without the ripple."""
        xy_mm = self.undone_mm(trace.xy_mm)
        _, noise_mm = best_half_width_s(trace.t_s, xy_mm[:, 1:], shown.edge_t_s + shown.guess_s)
        return replace(trace, xy_mm=xy_mm, noise_mm=noise_mm)

    def undone_mm(self, shown_mm: FloatArray) -> FloatArray:
        """Events without the ripple, (n, 2), taken on the smooth path: at noisy places it would add noise."""
        there = shown_mm
        for _ in range(INVERSE):
            there = shown_mm - _waves(_place(there), self.pitch_mm) @ self.sizes_mm
        return there


@lru_cache(maxsize=1)
def lattice_in(runs: tuple[RunData, ...]) -> Lattice | None:
    """Lattice in runs as shown."""
    return lattice_of([(data.t_s, data.xy_mm) for data in runs])


def lattice_of(traces: Sequence[tuple[FloatArray, FloatArray]]) -> Lattice | None:
    """Lattice in traces, ((n,) s, (n, 2) mm) each; None if no pitch stands out."""
    long = [(t_s, xy_mm) for t_s, xy_mm in traces if t_s.size > 10 * WINDOW]
    if not long:
        return None
    shown = [xy_mm for _, xy_mm in long]
    usual = [abs(np.log(max(_speed_mm_s(t_s, xy_mm), 1.0) / USUAL_MM_S)) for t_s, xy_mm in long]
    used = [shown[k] for k in np.argsort(usual)[:RUNS_SEARCHED]]
    power = _power([xy_mm[:MANY] for xy_mm in used])
    middle = float(np.median(power))
    if not power.max() > middle + STANDS_OUT * 1.4826 * float(np.median(np.abs(power - middle))):
        return None
    found = Lattice(float(PITCHES_MM[int(np.argmax(power))]), np.zeros((4, 2)))
    for finer in FINER:
        few = [(xy, _place(found.undone_mm(xy))) for xy in used]
        pitch_mm = max(found.pitch_mm * (1 + finer), key=lambda p: _fitted(few, float(p))[1])
        found = Lattice(float(pitch_mm), _fitted(few, float(pitch_mm))[0])
    for _ in range(SETTLING):
        every = [(xy, _place(found.undone_mm(xy))) for xy in shown]
        found = Lattice(found.pitch_mm, _fitted(every, found.pitch_mm)[0])
    return found


def _speed_mm_s(t_s: FloatArray, xy_mm: FloatArray) -> float:
    return float(np.median(np.hypot(*np.diff(xy_mm, axis=0).T) / np.maximum(np.diff(t_s), 1e-6)))


def _path(xy_mm: FloatArray) -> FloatArray:
    return smoothed(xy_mm, WINDOW, DEGREE)


def _place(xy_mm: FloatArray) -> FloatArray:
    return smoothed(xy_mm, WINDOW, BENDS)


def _deviation_from_path(values: FloatArray) -> FloatArray:
    return np.asarray((values - _path(values))[WINDOW:-WINDOW])


def _waves(xy_mm: FloatArray, pitch_mm: float) -> FloatArray:
    phase = 2 * np.pi / pitch_mm * xy_mm
    return np.column_stack([np.sin(phase[:, 0]), np.cos(phase[:, 0]), np.sin(phase[:, 1]), np.cos(phase[:, 1])])


def _power(runs: Sequence[FloatArray]) -> FloatArray:
    """Approximate explained square of waves of each pitch, (pitches,)."""
    kernel = -weights(WINDOW, DEGREE)
    kernel[WINDOW // 2] += 1
    turns = np.linspace(0, 0.5, 257)
    passes = np.abs(np.exp(2j * np.pi * turns[:, None] * np.arange(WINDOW)) @ kernel) ** 2  # of a wave, its power
    out = np.zeros(PITCHES_MM.size)
    for axis in (0, 1):
        where, off, steps = [], [], []
        for shown in runs:
            path = _path(shown)
            deviation = shown - path
            off.append((deviation - _path(deviation))[WINDOW:-WINDOW])  # twice: the wave's own deviation, by symmetry
            where.append(path[WINDOW:-WINDOW, axis])
            steps.append(np.abs(np.gradient(path[:, axis]))[WINDOW:-WINDOW])
        at_mm, deviation_mm = _on_grid(np.concatenate(where), np.concatenate(off))
        moment = np.exp(2j * np.pi * at_mm / PITCHES_MM[:, None]) @ deviation_mm
        count, edges = np.histogram(np.concatenate(steps), STEP_BINS)
        turn = 0.5 * (edges[1:] + edges[:-1]) / PITCHES_MM[:, None]
        size = np.interp(np.abs(turn - np.round(turn)), turns, passes) @ count
        out += np.sum(np.abs(moment) ** 2, axis=1) / np.maximum(size, 1.0)
    return out


def _on_grid(at_mm: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places (g,) on a grid, and values shared between neighbours, (g, 2)."""
    at = (at_mm - at_mm.min()) / GRID_MM
    left = at.astype(np.int64)
    share = at - left
    grid_mm = at_mm.min() + GRID_MM * np.arange(int(left.max()) + 2)
    columns = [
        np.bincount(left, (1 - share) * v, grid_mm.size) + np.bincount(left + 1, share * v, grid_mm.size)
        for v in values.T
    ]
    return grid_mm, np.column_stack(columns)


def _fitted(runs: Sequence[tuple[FloatArray, FloatArray]], pitch_mm: float) -> tuple[FloatArray, float]:
    """Sizes (4, 2) and explained square."""
    normal, moment = 1e-9 * np.eye(4), np.zeros((4, 2))
    for shown, path in runs:
        columns, off = _deviation_from_path(_waves(path, pitch_mm)), _deviation_from_path(shown)
        normal += columns.T @ columns
        moment += columns.T @ off
    sizes = np.linalg.solve(normal, moment)
    return np.asarray(sizes, float), float(np.sum(moment * sizes))
