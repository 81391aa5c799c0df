"""Recorded streams without effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from draglag.errors import DataError
from draglag.gap.replaying.realised import made
from draglag.gap.streams.evidence import inspect
from draglag.instruments.clocks import remapped, remapped_within
from draglag.latency.on_clock import nearby
from draglag.model.file import IN_THE_LAW, OF_SPEED, LatencyModel, ModelEffect
from draglag.path.events import sample_interval_s, usable
from draglag.path.inversion import Law, stylus_path
from draglag.recording import FloatArray, LaserTrace, Run, Session, TouchTrace
from draglag.simulation.effects import EFFECTS, Edges, Effect, title_of
from draglag.simulation.effects.parameter import sizes_in_words
from draglag.simulation.kinematics import GRID_HZ, Kinematics, Motion

LAW_UNDOES = "part of the latency law, which undoes it"
LONGEST_SHIFT_S = 0.05  # an edge of a stylus that hardly crosses the beam is not moved farther. Judgement


@dataclass(frozen=True)
class Correction:
    """Effects removed, and id → why others are left."""

    applied: tuple[ModelEffect, ...]
    left: dict[str, str]

    def words(self) -> str:
        """In one line; empty without effects."""
        out = []
        if self.applied:
            out.append("corrected for " + "; ".join(size_words(effect) for effect in self.applied))
        stays = {name: why for name, why in self.left.items() if why != LAW_UNDOES}
        if stays:
            out.append("not for " + "; ".join(f"{title_of(name)} ({why})" for name, why in stays.items()))
        undone = [title_of(name) for name in self.left if name not in stays]
        if undone:
            out.append(f"{', '.join(undone)} {'is' if len(undone) == 1 else 'are'} {LAW_UNDOES}")
        return ", ".join(out)

    @property
    def left_but_law(self) -> tuple[str, ...]:
        """Ids that neither the correction nor a law of speed undoes."""
        return tuple(name for name in self.left if EFFECTS[name].undone_in != OF_SPEED)

    def to_dict(self) -> dict[str, object]:
        return {
            "corrected_for": [{"effect": e.id, "parameters": dict(e.parameters)} for e in self.applied],
            "left_in": dict(self.left),
        }


def size_words(effect: ModelEffect) -> str:
    """As "clock drift 30 ppm (29.1 to 30.9)"."""
    sizes = sizes_in_words(EFFECTS[effect.id].parameters, effect.parameters, effect.ci95)
    return f"{title_of(effect.id)} {', '.join(sizes)}".strip()


def realise(effect: ModelEffect) -> Effect:
    """Simulated effect; a single number of unknown name is its main parameter."""
    if effect.shape is not None and effect.shape.sizes:
        shape = effect.shape
        value = next(iter(effect.parameters.values()), 0.0)
        fitted = EFFECTS[effect.id].of_shape(value, shape.theta, shape.sizes, shape.about)
        if fitted is not None:
            return fitted
    numbers = dict(effect.parameters)
    known = {spec.name for spec in EFFECTS[effect.id].parameters}
    main = EFFECTS[effect.id].parameters[0].name
    if len(numbers) == 1 and not known & set(numbers):
        numbers = {main: next(iter(numbers.values()))}
    return made(effect.id, numbers)


def corrected(session: Session, model: LatencyModel) -> tuple[Session, Correction]:
    """Session without a model's effects, and what was done.

    Its clock comparisons take precedence over the model's drift.
    """
    applied: list[ModelEffect] = []
    left: dict[str, str] = {}
    effects: list[Effect] = []
    compared = any(EFFECTS[item.id].removed_by_clock_comparisons for item in model.effects) and _clock_is_known(session)
    if compared:
        session = replace(session, runs=tuple(remapped(run, nearby(run, session.clocks)) for run in session.runs))
    for item in model.effects:
        undone_in = EFFECTS[item.id].undone_in
        if undone_in in IN_THE_LAW:
            left[item.id] = LAW_UNDOES if undone_in == OF_SPEED else "it follows the acceleration"
        elif EFFECTS[item.id].removed_by_clock_comparisons and compared:
            left[item.id] = "the session's own clock comparisons take it out"
        elif undone_in in ("laser", "touch"):
            applied.append(item)
            effects.append(realise(item))
        elif undone_in == "stream":
            seen, repaired = inspect(session)
            if any(found.effect == item.id for found in seen):
                session = repaired
                applied.append(item)
            else:
                left[item.id] = "the streams of this session do not show it"
        else:
            left[item.id] = "it cannot be undone"
    return without_effects(session, effects, model.latency_s), Correction(tuple(applied), left)


def without_effects(session: Session, effects: Sequence[Effect], law: Law) -> Session:
    """Session without effects; the law gives the motion."""
    if not effects:
        return session
    starts = [run.touch.t_s[0] for run in session.runs if run.touch.t_s.size]
    origin_s = float(min(starts)) if starts else 0.0
    size = (session.screen.width_mm, session.screen.height_mm)
    runs = tuple(_without(run, effects, law, origin_s, size, session) for run in session.runs)
    return replace(session, runs=runs)


def _clock_is_known(session: Session) -> bool:
    runs = [run for run in session.runs if len(run.laser.t_s)]
    if not runs or not all(len(run.laser.device_t_s) for run in runs):
        return False
    try:
        return all(remapped_within(run, nearby(run, session.clocks))[1] is not None for run in runs)
    except DataError:
        return False


def corrected_touch(
    t_s: FloatArray, x_mm: FloatArray, y_mm: FloatArray, model: LatencyModel
) -> tuple[FloatArray, FloatArray, FloatArray, Correction]:
    """Touch events without a model's effects, and what was done.

    Repeated positions get the time of the first.
    """
    size = (model.provenance.screen_width_mm or 0.0, model.provenance.screen_height_mm or 0.0)
    applied: list[ModelEffect] = []
    left: dict[str, str] = {}
    for item in model.effects:
        first_s = EFFECTS[item.id].first_shown_s(t_s, x_mm, y_mm)
        why_left = _why_left(EFFECTS[item.id], size[0] > 0, first_s is not None)
        if why_left:
            left[item.id] = why_left
            continue
        applied.append(item)
        if EFFECTS[item.id].undone_in != "touch" and first_s is not None:
            t_s = first_s
    effects = [realise(item) for item in applied if EFFECTS[item.id].undone_in == "touch"]
    done = Correction(tuple(applied), left)
    if not effects:
        return t_s, x_mm, y_mm, done
    good = np.isfinite(t_s) & np.isfinite(x_mm) & np.isfinite(y_mm)
    touch = usable(TouchTrace(t_s, x_mm, y_mm))
    if touch.t_s.size < 8:
        return t_s, x_mm, y_mm, done
    moved = _without_touch_effects(touch, effects, model.latency_s, float(touch.t_s[0]), size)
    index = np.clip(np.searchsorted(touch.t_s, t_s), 0, touch.t_s.size - 1)
    return (
        np.where(good, moved.t_s[index], np.nan),
        np.where(good, moved.x_mm[index], np.nan),
        np.where(good, moved.y_mm[index], np.nan),
        done,
    )


def merged(parts: Sequence[Correction]) -> Correction:
    """What was done to parts of a stream: an effect counts as removed where it was in any of them."""
    applied = {effect.id: effect for part in parts for effect in part.applied}
    left = {name: why for part in parts for name, why in part.left.items() if name not in applied}
    return Correction(tuple(applied.values()), left)


def _why_left(home: type[Effect], sized: bool, repeats: bool) -> str:
    """Why an effect cannot be undone in touch events; empty if it can.

    sized: the size of the screen is known. repeats: the events show which of them are repeated.
    """
    if home.undone_in in IN_THE_LAW:
        return LAW_UNDOES if home.undone_in == OF_SPEED else "it follows the acceleration"
    if home.undone_in == "laser" or not home.acts_on_touch():
        return "it does not act on touch"
    if home.follows == "session_time":
        return "the events do not say how long the screen had been on"
    if home.undone_in == "touch":
        return "" if sized else "the model does not say how large its screen is"
    return "" if repeats else "it cannot be undone"


def _hand(
    touch: TouchTrace, law: Law, origin_s: float, size_mm: tuple[float, float]
) -> tuple[Kinematics, FloatArray, FloatArray]:
    """Motion under a trace, its host times (g,), time that each event shows (n,)."""
    xy_mm = np.column_stack([touch.x_mm, touch.y_mm])
    path = stylus_path(touch.t_s, xy_mm, law, max(0.05, 4.5 * sample_interval_s(touch.t_s)))
    n = int((path.t_s[-1] - path.t_s[0]) * GRID_HZ)
    t = np.arange(n) / GRID_HZ
    host_s = t + path.t_s[0]
    x, y = (np.interp(host_s, path.t_s, column) for column in path.xy_mm.T)
    vx, vy = (np.interp(host_s, path.t_s, np.gradient(column, path.t_s)) for column in path.xy_mm.T)
    motion = Motion(t, x, y, vx, vy, np.ones(n, bool))
    return Kinematics(motion, host_s - origin_s, *size_mm), host_s, path.event_t_s


def _without_touch_effects(
    touch: TouchTrace, effects: Sequence[Effect], law: Law, origin_s: float, size_mm: tuple[float, float]
) -> TouchTrace:
    k, host_s, own_s = _hand(touch, law, origin_s, size_mm)
    rng = np.random.default_rng(0)
    late = np.zeros(host_s.size)
    x, y = k.motion.x_mm, k.motion.y_mm
    for effect in effects:
        late = effect.latency(late, k, rng)
        x, y = effect.position(x, y, k)
    t_s = touch.t_s - np.interp(own_s, host_s, late)
    # Where a latency jumps, events may overtake: they keep their order.
    t_s = np.maximum.accumulate(t_s + 1e-9 * np.arange(t_s.size))
    return replace(
        touch,
        t_s=t_s,
        x_mm=touch.x_mm - np.interp(own_s, host_s, x - k.motion.x_mm),
        y_mm=touch.y_mm - np.interp(own_s, host_s, y - k.motion.y_mm),
    )


def _without(
    run: Run, effects: Sequence[Effect], law: Law, origin_s: float, size_mm: tuple[float, float], session: Session
) -> Run:
    """Unchanged if the trace is too poor."""
    touch = usable(run.touch)
    if touch.t_s.size < 50 or not len(run.laser.t_s):
        return run
    try:
        restored = _without_touch_effects(touch, effects, law, origin_s, size_mm)
        k, host_s, _ = _hand(restored, law, origin_s, size_mm)
    except (DataError, ValueError):
        return run
    laser = _laser_without(run.laser, effects, k, host_s, origin_s, session.stylus.diameter_mm)
    return replace(run, touch=restored, laser=laser)


def _laser_without(
    laser: LaserTrace, effects: Sequence[Effect], k: Kinematics, host_s: FloatArray, origin_s: float, diameter_mm: float
) -> LaserTrace:
    t = laser.t_s - origin_s
    for effect in effects:
        t = t - (effect.laser_clock(t) - t)
    rng = np.random.default_rng(0)
    for effect in effects:
        shown = effect.edges(Edges(t, laser.light), rng)
        if shown.t_s.size == t.size:
            t = t - (shown.t_s - t)
    width, higher = np.full(host_s.size, diameter_mm), np.zeros(host_s.size)
    for effect in effects:
        width, higher = effect.diameter(width, k), effect.distance(higher, k)
    wider = np.interp(t + origin_s, host_s, width) - diameter_mm
    velocity = np.interp(t + origin_s, host_s, k.motion.vy_mm_s)
    across = np.maximum(np.abs(velocity), 1.0)
    # A wider shadow begins earlier and ends later; a beam that lies lower is reached later on the way down.
    early = np.clip(0.5 * wider / across, -LONGEST_SHIFT_S, LONGEST_SHIFT_S)
    lower = -np.sign(velocity) * np.interp(t + origin_s, host_s, higher)
    late = np.clip(lower / across, -LONGEST_SHIFT_S, LONGEST_SHIFT_S)
    t = t + np.where(laser.light == 0, early, -early) - late
    moved = t + origin_s - laser.t_s
    device = laser.device_t_s + moved if laser.device_t_s.size == moved.size else laser.device_t_s
    return replace(laser, t_s=laser.t_s + moved, device_t_s=device)
