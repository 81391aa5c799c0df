"""Modules that begin an effect's refits."""

from __future__ import annotations

from types import ModuleType

from draglag.simulation.effects import effect_class


def refit_module(effect: str) -> ModuleType | None:
    """Module of the effect, if any.

    Optional functions: ``refits(session, before, theta)``, ``shown_by_traces(before)`` (nats),
    ``shown_by_edges(before)``, ``possible_in(before)``."""
    home = effect_class(effect)
    return home.own_module() if home.refitted_by else None
