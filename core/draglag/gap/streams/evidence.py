"""Detection of effects in streams."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

from draglag.gap.streams.lattice import along, back, basis_of, is_turned, lengths_mm
from draglag.gap.streams.stamps import StreamEffect, Streams
from draglag.recording import Run, Session
from draglag.simulation.effects import EFFECTS

FEWEST = 50  # events of a run that is evidence. Judgement


def inspect(session: Session) -> tuple[tuple[StreamEffect, ...], Session]:
    """Effects that streams show, and the session repaired."""
    touches = [run.touch for run in session.runs if run.touch.t_s.size > FEWEST]
    if not touches:
        return (), session
    basis = basis_of(touches)
    if basis is None or not is_turned(basis):
        found, runs = _detected(session, (0.0, 0.0) if basis is None else lengths_mm(basis))
        return found, replace(session, runs=runs)
    turned = tuple(along(run, basis) for run in session.runs)
    found, runs = _detected(replace(session, runs=turned), lengths_mm(basis))
    each = zip(session.runs, turned, runs, strict=True)
    return found, replace(session, runs=tuple(own if run is it else back(run, basis) for own, it, run in each))


def _detected(session: Session, steps_mm: tuple[float, float]) -> tuple[tuple[StreamEffect, ...], tuple[Run, ...]]:
    """Effects, and the runs repaired. steps_mm: of x and y, 0 if none."""
    touches = [run.touch for run in session.runs if run.touch.t_s.size > FEWEST]
    streams, runs = Streams(session, touches, steps_mm), session.runs
    found: list[StreamEffect] = []
    homes = sorted((home for home in EFFECTS.values() if home.detected_by), key=lambda home: home.detection_order)
    for home in homes:
        effect, repaired = import_module(home.detected_by).detect(streams, runs)
        if effect is None or _possible(effect):
            runs = repaired
            found += [] if effect is None else [effect]
    return tuple(found), runs


def _possible(effect: StreamEffect) -> bool:
    """Whether every parameter lies within its bounds: beyond them it is something else."""
    bounds = {spec.name: spec for spec in EFFECTS[effect.effect].parameters}
    return all(
        bounds[name].lower <= value <= bounds[name].upper
        for name, (value, _) in effect.parameters.items()
        if name in bounds
    )
