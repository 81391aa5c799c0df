"""``session.json`` of an exchange folder, validated: which key, and what was expected."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from draglag.errors import DataError

FORMAT = "draglag-exchange"
VERSION = 1
_MAX_BYTES = 16 * 2**20

# Strict: "44" and true are no numbers, and what they were meant to be would be a guess.
Positive = Annotated[float, Field(gt=0, strict=True)]
NotNegative = Annotated[float, Field(ge=0, strict=True)]
FileName = Annotated[str, StringConstraints(pattern=r"^[^/\\\x00]+$", max_length=200)]


class _Part(BaseModel):
    model_config = ConfigDict(allow_inf_nan=False, extra="ignore", frozen=True)


class ScreenPart(_Part):
    name: str
    width_mm: Positive
    height_mm: Positive
    width_px: Annotated[int, Field(gt=0)]
    height_px: Annotated[int, Field(gt=0)]


class RunPart(_Part):
    """``start_s`` and ``duration_s`` may be null: then the run spans its samples. ``target`` and ``outcome`` are
    draglag's own additions, which other readers may ignore."""

    id: str
    protocol: Literal["circle", "chirp", "multisine", "step", "free"]
    nominal_speed_mm_s: NotNegative | None = None
    radius_mm: Positive | None = None
    duration_s: NotNegative | None = None
    start_s: Annotated[float, Field(strict=True)] | None = None
    target: dict[str, float | int | str] = Field(default_factory=dict)
    outcome: Literal["complete", "aborted", "device_lost", "failed"] = "complete"


class HeaderPart(_Part):
    format: Literal["draglag-exchange"]
    version: Literal[1]
    screen: ScreenPart
    stylus_diameter_mm: Positive
    clock: str = ""
    runs: list[RunPart]
    taps: FileName | None = None
    name: str | None = None


def read_header(path: Path) -> HeaderPart:
    """The validated header. Raises DataError naming the file and the line or key."""
    data = _json(path)
    if not isinstance(data, dict):
        raise DataError(f"{path}: expected a JSON object with the keys format, version, screen, runs")
    if data.get("format") == FORMAT and isinstance(data.get("version"), int) and data["version"] > VERSION:
        raise DataError(
            f"{path}: is version {data['version']} of the exchange format, this draglag knows {VERSION}",
            "Install a newer draglag",
        )
    try:
        return HeaderPart.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in first["loc"]).lstrip(".")
        given = "" if first["type"] == "missing" else f", not {json.dumps(first['input'], default=str)[:60]}"
        raise DataError(f"{path}: {where}: {_plain(first)}{given}", "Correct this key and import again") from error


def _json(path: Path) -> Any:
    if not path.parent.is_dir():
        raise DataError(f"{path.parent}: there is no such folder", "Name the folder that holds session.json")
    if not path.is_file():
        raise DataError(f"{path.parent}: holds no session.json", "Name the folder that holds session.json")
    if path.stat().st_size > _MAX_BYTES:
        raise DataError(f"{path}: is too large for a header ({path.stat().st_size} bytes)")
    try:
        return json.loads(path.read_text("utf-8-sig"))
    except json.JSONDecodeError as error:
        raise DataError(
            f"{path}, line {error.lineno}, column {error.colno}: is not JSON ({error.msg})", "Correct that line"
        ) from error
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: is not UTF-8 text (byte {error.start})", "Save it as UTF-8") from error
    except RecursionError as error:
        raise DataError(f"{path}: is nested too deep for a header", "Write the keys as the README shows") from error
    except ValueError as error:  # a number of thousands of digits
        raise DataError(f"{path}: holds a number that is too long", "Correct that number") from error
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error


def _plain(error: Any) -> str:
    """Pydantic's message as an expectation."""
    text = str(error["msg"]).split(", unable to parse")[0].split(" or instance of ")[0]
    text = text.replace("a valid dictionary", "an object {…}").replace("a valid list", "a list […]")
    if error["type"] == "missing":
        return "is missing"
    if error["type"] == "string_pattern_mismatch":
        return "expected the name of a file in the same folder"
    return text.replace("Input should be", "expected").replace("Input", "input")
