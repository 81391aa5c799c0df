"""The module in which an effect begins its refits, where a plain one does not find it."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from draglag.simulation.effects import effect_class


def own_way(effect: str) -> ModuleType | None:
    """It may have ``refits(session, before, theta)``, ``shown_by_traces(before)`` and ``judged(placed, term)``."""
    name = effect_class(effect).refitted_by
    return import_module(name) if name else None
