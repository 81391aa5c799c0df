"""Presets and files in TOML."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import PydanticCustomError

from draglag.errors import DataError
from draglag.messages import message
from draglag.reading import parse_toml, read_text
from draglag.reading.limits import DOCUMENT_BYTES, SIZE_MM, SIZE_PX
from draglag.reading.refusals import refusal
from draglag.recording import Screen
from draglag_resources import presets, resource


def _a_number(value: object) -> object:
    if isinstance(value, bool):
        raise PydanticCustomError("float_type", "Input should be a valid number")  # true is no number
    return value


Positive = Annotated[float, BeforeValidator(_a_number), Field(gt=0, allow_inf_nan=False)]
Length = Annotated[Positive, Field(le=SIZE_MM)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Panel(Strict):
    width_mm: Length
    height_mm: Length
    width_px: Annotated[int, Field(gt=0, le=SIZE_PX)]
    height_px: Annotated[int, Field(gt=0, le=SIZE_PX)]


class _StylusTable(Strict):
    diameter_mm: Length = 7.0


class LawTable(Strict):
    """Eq. 5 without the redundant a3 and a6, as in Table 2."""

    a1_ms: NotNegative
    a2_s_per_mm: NotNegative
    a4_ms: NotNegative
    a5_s_per_mm: NotNegative
    a7_ms: NotNegative


class _Digitiser(Strict):
    touch_rate_hz: Positive = 120.0
    scan_jitter_s: NotNegative = 1e-4
    noise_mm: NotNegative = 0.15
    resolution_mm: NotNegative = 0.02


class _TapTable(Strict):
    touch_median_s: Positive = 0.030
    release_median_s: Positive = 0.0285
    spread_s: NotNegative = 0.0025


class ScreenFile(Strict):
    """A screen preset: the panel, and its behaviour in the simulation."""

    name: Annotated[str, Field(min_length=1)]
    description: str = ""
    screen: _Panel
    stylus: _StylusTable = _StylusTable()
    law: LawTable | None = None
    digitiser: _Digitiser = _Digitiser()
    taps: _TapTable = _TapTable()


_Model = TypeVar("_Model", bound=BaseModel)


def _text_of(name_or_path: str | Path, folder: str) -> tuple[str, str]:
    preset = resource(folder, f"{name_or_path}.toml")
    what = folder.removesuffix("s")
    if isinstance(name_or_path, str) and re.fullmatch(r"[\w-]{1,100}", name_or_path) and preset.is_file():
        return f"{what} '{name_or_path}'", preset.read_text("utf-8")
    path = Path(name_or_path)
    if not os.path.exists(path):
        known = ", ".join(presets(folder))
        raise DataError(
            message(
                "no protocol preset or file '{name_or_path}'"
                if folder == "protocols"
                else "no screen preset or file '{name_or_path}'",
                name_or_path=name_or_path,
            ),
            message("presets are {known}; or give a TOML file", known=known),
        )
    return str(path), read_text(path, DOCUMENT_BYTES, message("give a TOML file"))


def _line_of(text: str, location: Sequence[int | str]) -> int:
    lines = text.splitlines()
    at = 0
    for depth, part in enumerate(location):
        nth = location[depth + 1] if depth + 1 < len(location) else 0
        if isinstance(part, int):
            continue
        header = re.compile(rf"\s*\[\[?\s*{re.escape(part)}\s*\]\]?")
        hits = [i for i, line in enumerate(lines) if header.match(line)]
        if hits:
            at = hits[nth if isinstance(nth, int) and nth < len(hits) else 0]
            continue
        key = re.compile(rf"\s*{re.escape(part)}\s*=")
        for i in range(at, len(lines)):
            if i > at and lines[i].lstrip().startswith("["):
                break
            if key.match(lines[i]):
                at = i
                break
    return at + 1


def read_toml(name_or_path: str | Path, folder: str, model: type[_Model]) -> tuple[_Model, str]:
    """(model, text) of one TOML file or preset. Raises DataError naming file and line."""
    label, text = _text_of(name_or_path, folder)
    data = parse_toml(text, label)
    try:
        return model.model_validate(data), text
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part + 1) if isinstance(part, int) else part for part in first["loc"])
        what = refusal(first)
        if place:
            what = message("{key}: {what}", key=place, what=what)
        line = _line_of(text, first["loc"])
        raise DataError(
            message("{path}, line {line}: {what}", path=label, line=line, what=what), "correct the file"
        ) from error


def load_screen_file(name_or_path: str | Path) -> ScreenFile:
    """A whole screen preset or file."""
    return read_toml(name_or_path, "screens", ScreenFile)[0]


def load_screen(name_or_path: str | Path) -> Screen:
    """The panel of a screen preset or TOML file."""
    preset = load_screen_file(name_or_path)
    return Screen(preset.name, **preset.screen.model_dump())
