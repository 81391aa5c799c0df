"""Modules of effects that need a special start of their refits."""

from __future__ import annotations

from types import ModuleType

from draglag.simulation.effects import effect_class


def refit_module(effect: str) -> ModuleType | None:
    """The effect's module, or None. Optional functions: ``refits(session, before, theta)``,
    ``shown_by_traces(before)``, ``shown_by_edges(before)``, ``possible_in(before)``, ``open_mm(placed, term)``.
    """
    home = effect_class(effect)
    return home.own_module() if home.refitted_by else None
