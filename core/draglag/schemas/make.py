"""Schemas and generated pages, written into the documentation."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from draglag.exchange.header import HeaderPart
from draglag.model.file import LatencyModel
from draglag.schemas.library import library_page
from draglag.schemas.outputs import AnalyzeOutput, CompareOutput, GapOutput
from draglag.schemas.session_file import layout_schema, page

_MODELS: dict[str, type[BaseModel]] = {
    "exchange": HeaderPart,
    "model": LatencyModel,
    "analyze": AnalyzeOutput,
    "gap": GapOutput,
    "compare": CompareOutput,
}


def schemas() -> dict[str, dict[str, Any]]:
    """Name → JSON Schema (draft 2020-12)."""
    made: dict[str, dict[str, Any]] = {"session-file": layout_schema()}
    for name, model in _MODELS.items():
        made[name] = {"$schema": "https://json-schema.org/draft/2020-12/schema", **model.model_json_schema()}
    return made


def files() -> dict[str, str]:
    """Path below the documentation's folder → content."""
    texts = {
        f"schemas/{name}.json": json.dumps(schema, indent=1, ensure_ascii=False) + "\n"
        for name, schema in schemas().items()
    }
    return {**texts, "session-file.md": page(), "effects-library.md": library_page()}


def write(docs: Path) -> None:
    """Write all files."""
    (docs / "schemas").mkdir(parents=True, exist_ok=True)
    for name, text in files().items():
        (docs / name).write_text(text, "utf-8")
