"""draglag: how far a touchscreen lags behind a dragged stylus, as a function of drag speed.

The library reads top to bottom in the order the data flows: ``recording`` (what was measured), ``store`` and
``exchange`` (files), ``motion`` and ``beam`` (what it means), ``latency`` and ``curve`` (the estimates),
``validation`` and ``compensation`` (their use), ``simulation`` and ``gap`` (where model and measurement differ).
"""

from __future__ import annotations

__version__: str


def __getattr__(name: str) -> object:
    """``__version__``, which takes longer to look up than the rest of this module."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version

    try:
        found = version("draglag")
    except PackageNotFoundError:  # a bare checkout on the path, not installed
        found = "0+unknown"
    globals()["__version__"] = found
    return found
