"""The only door to what is judged: hand it a folder, get back the JSON of `draglag gap`."""

import importlib
import importlib.util
import json
import time
from pathlib import Path
from typing import Any


def missing() -> str | None:
    """Why the workflow cannot be run here, or None."""
    for module, name in (("draglag.gap", "close_gap"), ("draglag.exchange", "read_exchange")):
        try:
            found = importlib.util.find_spec(module) is not None
        except ModuleNotFoundError:
            found = False
        if not found or not hasattr(importlib.import_module(module), name):
            return f"{module}.{name} is not there"
    return None


def close(
    folder: Path, excluded: tuple[str, ...] = (), max_effects: int | None = None, engine: str | None = None
) -> dict[str, Any]:
    """Gap report of one exchange folder as plain data, with `seconds`; `excluded` leave the library.

    engine: "module:function" of another one, from a folder to such a report.
    """
    begin = time.perf_counter()
    report = _other(engine, folder) if engine else _own(folder, excluded, max_effects)
    out: dict[str, Any] = json.loads(json.dumps(report))
    out["seconds"] = time.perf_counter() - begin
    return out


def _other(engine: str, folder: Path) -> dict[str, Any]:
    module, _, function = engine.partition(":")
    report: dict[str, Any] = getattr(importlib.import_module(module), function)(folder)
    return report


def _own(folder: Path, excluded: tuple[str, ...], max_effects: int | None) -> dict[str, object]:
    from draglag.errors import DraglagError
    from draglag.exchange import read_exchange
    from draglag.gap import close_gap
    from draglag.simulation.effects import EFFECTS

    candidates = [name for name in EFFECTS if name not in excluded] if excluded else None
    options: dict[str, Any] = {} if max_effects is None else {"max_effects": max_effects}
    try:
        return close_gap(read_exchange(folder), candidates=candidates, **options).to_dict()
    except DraglagError as error:
        report: dict[str, object] = {"verdict": "refused", "steps": [], "unexplained_by": None, "problem": str(error)}
        return report | {"gap_first_mm": None, "gap_last_mm": None, "noise_floor_mm": None}
