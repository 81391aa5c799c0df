"""Effects, estimators and device schemes of other packages, by entry points."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator


def brought(group: str, noun: str, problem_of: Callable[[str, object], str]) -> Iterator[tuple[str, object]]:
    """Name and object of a group's entry points; unusable ones are left out with a warning.

    ``problem_of``: (name, object) → what keeps it from being used.
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
