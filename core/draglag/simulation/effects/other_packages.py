"""Effects from entry points of the group ``draglag.effects``."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from typing import cast

from draglag.simulation.effects.base import Effect
from draglag.system.plugins import brought

GROUP = "draglag.effects"


def effects_of_other_packages(known: Collection[str]) -> Iterator[type[Effect]]:
    """Usable effects by entry point name; others give a warning. known: ids taken."""
    taken = set(known)
    for _, found in brought(GROUP, "effect", lambda name, effect: _problem(effect, taken)):
        effect = cast(type[Effect], found)
        taken.add(effect.id)
        yield effect


def _problem(effect: object, taken: Collection[str]) -> str:
    if not (isinstance(effect, type) and issubclass(effect, Effect)):
        return "it is no subclass of draglag.simulation.effects.Effect"
    missing = [name for name in ("id", "meaning", "parameters") if not getattr(effect, name, None)]
    if missing:
        return f"it has no {missing[0]}"
    if not re.fullmatch(r"[a-z][a-z0-9_]*", effect.id):
        return f"its id {effect.id!r} is not of lower-case letters, digits and underscores"
    if effect.id in taken:
        return f"its id {effect.id} is taken"
    effect.typical()  # within its own bounds
    return ""
