"""draglag: how far a touchscreen lags behind a dragged stylus, as a function of drag speed.

The library reads top to bottom in the order the data flows: ``recording`` (what was measured), ``store`` and
``exchange`` (files), ``motion`` and ``beam`` (what it means), ``latency`` and ``curve`` (the estimates),
``validation`` and ``compensation`` (their use), ``simulation`` and ``gap`` (where model and measurement differ).
"""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("draglag")
except PackageNotFoundError:  # a bare checkout on the path, not installed
    __version__ = "0+unknown"
