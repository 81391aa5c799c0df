"""Makes the sessions of a task: in a scratch folder, or in one where they are kept for several engines."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from .conditions import Task, profile_for
from .displacement import Displacement, displacements
from .known import Known, from_json, known_of, size_of_interest, to_json
from .physics.rig import Profile
from .physics.session import Truth, make_session
from .realistic import MATTERS_MM, refitted
from .visibility import JUST_DETECTABLE, visibility


@dataclass(frozen=True)
class Made:
    """A session on disk, the profile it was drawn from, and what is known of it."""

    folder: Path
    profile: Profile
    known: Known


def name_of(task: Task) -> str:
    """Folder of a kept session. Whoever judges sees the folder, not its name."""
    return f"{task.world}-{task.kind}-{task.row}-{task.scale:g}-{task.seed}"


def kept_or_made(task: Task, scratch: Path, keep: Path | None) -> Made:
    """The session of a task: from `keep` where it lies there already, else made (there, or in `scratch`)."""
    if keep is None:
        return make(task, scratch / "session")[0]
    folder, label = keep / "sessions" / name_of(task), keep / "truth" / f"{name_of(task)}.json"
    if label.is_file():
        data = json.loads(label.read_text())
        if data["task"] == json.loads(json.dumps(asdict(task))):
            return Made(folder, _profile(task), from_json(data)[1])
    made, truth = make(task, folder)
    label.parent.mkdir(parents=True, exist_ok=True)
    label.write_text(json.dumps(to_json(task, truth, made.known), indent=1))
    return made


def make(task: Task, folder: Path) -> tuple[Made, Truth]:
    """Write the session of a task to `folder`."""
    profile, effects = _profile(task), dict(task.effects)
    if task.world == "plain":
        effects, size = _plain_size(task, profile)
        displaced, together = displacements(task.seed, effects, profile)
    else:
        effects, displaced, together = _realistic_size(task, profile)
        size = size_of_interest(effects, together)
    truth = make_session(folder, task.seed, effects, profile)
    return Made(folder, profile, known_of(truth, displaced, together, size)), truth


def _profile(task: Task) -> Profile:
    return profile_for(task.effects, task.world, task.law_form)


def _realistic_size(
    task: Task, profile: Profile
) -> tuple[dict[str, float], dict[str, Displacement], Displacement | None]:
    """Effects of a task at sizes that matter, or deliberately do not, and what they move.

    What cannot matter (a law absorbs it at any realistic size) stays as drawn.
    """
    effects = dict(task.effects)
    displaced, together = displacements(task.seed, effects, profile)
    other = refitted(task, together.gap_mm) if together else None
    if other:
        moved, in_all = displacements(task.seed, other, profile)
        if task.kind == "below" or (in_all and in_all.gap_mm >= MATTERS_MM):
            return other, moved, in_all
    return effects, displaced, together


def _plain_size(task: Task, profile: Profile) -> tuple[dict[str, float], float | None]:
    """Effects of a task, faint ones at their size, and that of the least visible one in just-detectable sizes."""
    if not task.effects:
        return {}, None
    twin = make_session(None, task.seed, {}, profile)

    def seen(effects: dict[str, float]) -> float | None:
        return visibility(make_session(None, task.seed, effects, profile), twin)

    alone = [d for name, size in task.effects.items() if (d := seen({name: size})) is not None]
    d = min(alone, default=None)
    effects = dict(task.effects)
    if task.kind == "faint" and d:
        effects = {key: value * task.scale * JUST_DETECTABLE / d for key, value in effects.items()}
        d = seen(effects)
    return effects, None if d is None else d / JUST_DETECTABLE


def make_twin(task: Task, made: Made, folder: Path) -> None:
    """Write the session without anything hidden to `folder`."""
    make_session(folder, task.seed, {}, made.profile)
