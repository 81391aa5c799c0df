"""Laser edges from the stylus' motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.recording import Beam, FloatArray
from draglag.simulation.digitiser import Stream
from draglag.simulation.effects.base import Edges, Effect
from draglag.simulation.kinematics import Kinematics
from draglag.simulation.rig import Rig


def beam_distance_mm(beam: Beam, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
    """Signed distance from the beam, positive below it."""
    return np.asarray((y_mm - beam.slope * x_mm - beam.intercept_mm) / np.hypot(1.0, beam.slope))


def shadow_edges(rig: Rig, k: Kinematics, effects: Sequence[Effect]) -> Edges:
    """True edges in session time: dark while the stylus is down and within half its diameter of the beam."""
    m = k.motion
    diameter = np.full(len(m.t_s), rig.stylus.diameter_mm)
    for effect in effects:
        diameter = effect.diameter(diameter, k)
    distance = beam_distance_mm(rig.beam, m.x_mm, m.y_mm)
    for effect in effects:
        distance = effect.distance(distance, k)
    clear = np.abs(distance) - diameter / 2
    lit = (clear >= 0) | ~m.in_contact
    i = np.flatnonzero(np.diff(lit.astype(np.int8)))
    crossing = (clear[i] >= 0) != (clear[i + 1] >= 0)  # otherwise the stylus came down on the beam, or left it
    change = np.where(crossing, clear[i] - clear[i + 1], 1.0)
    share = np.where(crossing, clear[i] / change, 0.5)
    t = k.session_s[i] + np.clip(share, 0.0, 1.0) * k.step_s
    return Edges(t, lit[i + 1].astype(np.int64))


def sensor_edges(rig: Rig, true_edges: Edges, effects: Sequence[Effect], stream: Stream) -> Edges:
    """Edges as the sensor reports them, on a perfect clock."""
    edges = Edges(true_edges.t_s + rig.sensor_response_s, true_edges.light)
    for effect in sorted(effects, key=lambda e: e.order):
        edges = effect.edges(edges, stream(effect.id + " edges"))
    order = np.argsort(edges.t_s, kind="stable")
    return Edges(edges.t_s[order], edges.light[order])
