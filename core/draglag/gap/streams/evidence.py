"""Detection of effects in streams."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

from draglag.gap.streams.stamps import StreamEffect, Streams, resolutions_mm
from draglag.recording import Session
from draglag.simulation.effects import EFFECTS

FEWEST = 50  # events of a run that is evidence. Judgement


def inspect(session: Session) -> tuple[tuple[StreamEffect, ...], Session]:
    """Effects that streams show, and the session repaired."""
    touches = [run.touch for run in session.runs if run.touch.t_s.size > FEWEST]
    if not touches:
        return (), session
    streams, runs = Streams(session, touches, resolutions_mm(touches)), session.runs
    found: list[StreamEffect] = []
    homes = sorted((home for home in EFFECTS.values() if home.detected_by), key=lambda home: home.detection_order)
    for home in homes:
        effect, repaired = import_module(home.detected_by).detect(streams, runs)
        if effect is None or _possible(effect):
            runs = repaired
            found += [] if effect is None else [effect]
    return tuple(found), replace(session, runs=runs)


def _possible(effect: StreamEffect) -> bool:
    """Whether every parameter lies within its bounds: beyond them it is something else."""
    bounds = {spec.name: spec for spec in EFFECTS[effect.effect].parameters}
    return all(
        bounds[name].lower <= value <= bounds[name].upper
        for name, (value, _) in effect.parameters.items()
        if name in bounds
    )
