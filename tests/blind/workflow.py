"""The only door to what is judged: hand it a folder, get back the JSON of `draglag gap`."""

import importlib
import importlib.util
import json
import time
from pathlib import Path
from typing import Any

from .physics.effects import LIBRARY


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


def close(folder: Path, excluded: tuple[str, ...] = (), max_effects: int | None = None) -> dict[str, Any]:
    """Gap report of one exchange folder as plain data, and the `seconds` it took; `excluded` leave the library."""
    from draglag.errors import DraglagError
    from draglag.exchange import read_exchange
    from draglag.gap import close_gap

    candidates = [name for name in LIBRARY if name not in excluded] if excluded else None
    options: dict[str, Any] = {} if max_effects is None else {"max_effects": max_effects}
    begin = time.perf_counter()
    try:
        report = close_gap(read_exchange(folder), candidates=candidates, **options).to_dict()
    except DraglagError as error:
        report = {"verdict": "refused", "steps": [], "unexplained_by": None, "problem": str(error)}
        report |= {"gap_first_mm": None, "gap_last_mm": None, "noise_floor_mm": None}
    out: dict[str, Any] = json.loads(json.dumps(report))
    out["seconds"] = time.perf_counter() - begin
    return out
