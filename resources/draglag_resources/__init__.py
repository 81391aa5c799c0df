"""Protocols, screens, icons, theme, manual and translations, read through importlib.resources."""

from __future__ import annotations

from importlib.resources import files
from importlib.resources.abc import Traversable


def resource(folder: str, name: str) -> Traversable:
    """The file ``name`` in ``folder``; it need not exist."""
    return files(__name__) / folder / name


def presets(folder: str, suffix: str = ".toml") -> list[str]:
    """Names, without the suffix, of what ``folder`` holds, sorted."""
    return sorted(
        entry.name.removesuffix(suffix) for entry in (files(__name__) / folder).iterdir() if entry.name.endswith(suffix)
    )
