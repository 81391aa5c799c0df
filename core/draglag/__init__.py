"""draglag: how far a touchscreen lags behind a dragged stylus, as a function of drag speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from draglag.analysis import Analysis
    from draglag.curve import CurveFit
    from draglag.errors import DataError, DraglagError, EstimateError
    from draglag.face import (
        analyze,
        compare,
        compensate,
        export,
        find_gap,
        fit_curve,
        load_model,
        model_of,
        protocol_names,
        read,
        save_model,
        screen_names,
        simulate,
        write,
        write_report,
    )
    from draglag.gap.results import GapReport
    from draglag.model.file import LatencyModel
    from draglag.recording import Run, Session

    __version__: str

_HOMES = {
    "Analysis": "analysis",
    "CurveFit": "curve",
    "DataError": "errors",
    "DraglagError": "errors",
    "EstimateError": "errors",
    "GapReport": "gap.results",
    "LatencyModel": "model.file",
    "Run": "recording",
    "Session": "recording",
    "analyze": "face",
    "compare": "face",
    "compensate": "face",
    "export": "face",
    "find_gap": "face",
    "fit_curve": "face",
    "load_model": "face",
    "model_of": "face",
    "protocol_names": "face",
    "read": "face",
    "save_model": "face",
    "screen_names": "face",
    "simulate": "face",
    "write": "face",
    "write_report": "face",
}

__all__ = [
    "Analysis",
    "CurveFit",
    "DataError",
    "DraglagError",
    "EstimateError",
    "GapReport",
    "LatencyModel",
    "Run",
    "Session",
    "analyze",
    "compare",
    "compensate",
    "export",
    "find_gap",
    "fit_curve",
    "load_model",
    "model_of",
    "protocol_names",
    "read",
    "save_model",
    "screen_names",
    "simulate",
    "write",
    "write_report",
]

if not TYPE_CHECKING:  # a type checker sees the names above, and no others

    def __getattr__(name: str) -> object:
        if name in _HOMES:
            from importlib import import_module

            found: object = getattr(import_module(f"draglag.{_HOMES[name]}"), name)
        elif name == "__version__":
            found = _version()
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = found
        return found

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__, "__version__"})


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("draglag")
    except PackageNotFoundError:  # a bare checkout on the path, not installed
        return "0+unknown"
