"""What other packages bring by entry points: effects, estimators, device schemes."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator


def brought(group: str, noun: str, problem_of: Callable[[str, object], str]) -> Iterator[tuple[str, object]]:
    """Name and object of the entry points of a group, by name; one that cannot be used is left out with a warning.

    Args:
        group: "draglag.effects", … noun: what such an object is called in the warning.
        problem_of: from name and object, what keeps it from being used; empty where nothing does.
    """
    from importlib.metadata import entry_points  # takes longer to import than all of what it finds here

    for entry in sorted(entry_points(group=group), key=lambda entry: entry.name):
        try:
            found: object = entry.load()
            problem = problem_of(entry.name, found)
        except Exception as error:  # whatever a stranger's module does on import
            problem = f"{type(error).__name__}: {error}"
        if problem:
            warnings.warn(f"{noun} {entry.name} ({entry.value}) is left out: {problem}", stacklevel=2)
            continue
        yield entry.name, found
