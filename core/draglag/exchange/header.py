"""``session.json`` of an exchange folder, validated."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints, ValidationError, model_validator

from draglag.errors import DataError
from draglag.messages import Message, message
from draglag.reading import parse_json, read_text
from draglag.reading.limits import HEADER_BYTES, RUNS, SIZE_MM, SIZE_PX, TIME_S
from draglag.reading.refusals import refusal

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

FORMAT = "draglag-exchange"
VERSION = 1

# Strict: "44" and true are no numbers, and what they were meant to be would be a guess.
Positive = Annotated[float, Field(gt=0, strict=True)]
NotNegative = Annotated[float, Field(ge=0, strict=True)]
Number = Annotated[float, Field(strict=True)]
Stamp = Annotated[float, Field(ge=-TIME_S, le=TIME_S, strict=True)]
Length = Annotated[float, Field(gt=0, le=SIZE_MM, strict=True)]
Whole = Annotated[int, Field(strict=True)]
Whole64 = Annotated[int, Field(ge=-(2**63), lt=2**63, strict=True)]
Count = Annotated[int, Field(ge=0, lt=2**63, strict=True)]
FileName = Annotated[str, StringConstraints(pattern=r"^[^/\\\x00]+$", max_length=200)]


class _Part(BaseModel):
    model_config = ConfigDict(allow_inf_nan=False, extra="ignore", frozen=True)


class ScreenPart(_Part):
    name: str
    width_mm: Length
    height_mm: Length
    width_px: Annotated[int, Field(gt=0, le=SIZE_PX)]
    height_px: Annotated[int, Field(gt=0, le=SIZE_PX)]


class EntryPart(_Part):
    """One line of a log."""

    t_s: Stamp
    level: str
    source: str
    text: str


def _lines(value: object) -> object:
    """A plain text, as other labs write it, is one note."""
    return [{"t_s": 0.0, "level": "note", "source": "import", "text": value}] if isinstance(value, str) else value


Entries = Annotated[list[EntryPart], BeforeValidator(_lines)]


class ClockPart(_Part):
    """Clock comparisons of one stream: ``file`` holds device_s, host_min_s, host_max_s and perhaps epoch."""

    stream: str
    file: FileName


class AxisPart(_Part):
    name: str
    minimum: Whole64
    maximum: Whole64
    resolution: Whole64 = 0
    fuzz: Whole64 = 0


class BeamPart(_Part):
    slope: Number
    intercept_mm: Number


class CalibrationPart(_Part):
    """Touched targets and their affine map, as in ``TouchCalibration``: lists of one length, the matrix 2 × 3."""

    x_raw: list[Number]
    y_raw: list[Number]
    x_mm: list[Number]
    y_mm: list[Number]
    matrix: Annotated[
        list[Annotated[list[Number], Field(min_length=3, max_length=3)]], Field(min_length=2, max_length=2)
    ]
    device: str = ""
    made_utc: str = ""

    @model_validator(mode="after")
    def _one_length(self) -> CalibrationPart:
        if len({len(self.x_raw), len(self.y_raw), len(self.x_mm), len(self.y_mm)}) != 1:
            raise ValueError(message("expected x_raw, y_raw, x_mm and y_mm of one length"))
        return self


class RunPart(_Part):
    """``start_s`` and ``duration_s`` may be null: then the run spans its samples. Everything from ``target`` on is
    optional, and other readers may ignore it (docs/exchange.md)."""

    id: str
    protocol: Literal["circle", "chirp", "multisine", "step", "free"]
    nominal_speed_mm_s: NotNegative | None = None
    radius_mm: Length | None = None
    duration_s: Annotated[float, Field(ge=0, le=TIME_S, strict=True)] | None = None
    start_s: Stamp | None = None
    target: dict[str, float | int | str] = Field(default_factory=dict)
    outcome: Literal["complete", "aborted", "device_lost", "failed"] = "complete"
    seed: Whole | None = None
    as_recorded: bool = False
    touch_dropped: Count = 0
    touch_axes: list[AxisPart] = Field(default_factory=list)
    laser_missed: Count | None = None
    display_missed: Count = 0
    sync: list[ClockPart] = Field(default_factory=list)
    log: Entries = Field(default_factory=list)


class HeaderPart(_Part):
    format: Literal["draglag-exchange"]
    version: Literal[1]
    screen: ScreenPart
    stylus_diameter_mm: Length
    clock: str = ""
    runs: Annotated[list[RunPart], Field(max_length=RUNS)]
    taps: FileName | None = None
    name: str | None = None
    stylus_name: str = ""
    started_utc: str = ""
    started_s: Stamp | None = None
    seed: Whole | None = None
    software: str = ""
    simulated: Annotated[bool, Field(strict=True)] = False
    devices: dict[str, str] = Field(default_factory=dict)
    details: dict[str, str] = Field(default_factory=dict)
    beam: BeamPart | None = None
    calibration: CalibrationPart | None = None
    clocks: list[ClockPart] = Field(default_factory=list)
    protocol_file: FileName | None = None
    taps_rejected: dict[str, Count] = Field(default_factory=dict)
    notes: Entries = Field(default_factory=list)


def read_header(path: Path) -> HeaderPart:
    """The validated header. Raises DataError naming the line or key."""
    data = _json(path)
    if not isinstance(data, dict):
        raise DataError(
            message("{path}: expected a JSON object with the keys format, version, screen, runs", path=path)
        )
    if data.get("format") == FORMAT and isinstance(data.get("version"), int) and data["version"] > VERSION:
        raise DataError(
            message(
                "{path}: is version {version} of the exchange format, this draglag knows {known}",
                path=path,
                version=data["version"],
                known=VERSION,
            ),
            "Install a newer draglag",
        )
    try:
        return HeaderPart.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in first["loc"]).lstrip(".")
        problem = message("{path}: {where}: {what}", path=path, where=where, what=_plain(first))
        if first["type"] != "missing":
            given = json.dumps(first["input"], default=str)[:60]
            problem = message("{problem}, not {given}", problem=problem, given=given)
        raise DataError(problem, "Correct this key and import again") from error


def _json(path: Path) -> Any:
    if not os.path.isdir(path.parent):
        raise DataError(
            message("{path}: there is no such folder", path=path.parent), "Name the folder that holds session.json"
        )
    if not os.path.exists(path):
        raise DataError(
            message("{path}: holds no session.json", path=path.parent), "Name the folder that holds session.json"
        )
    return parse_json(read_text(path, HEADER_BYTES), path, message("Correct that line"))


def _plain(fault: ErrorDetails) -> Message:
    if fault["type"] == "string_pattern_mismatch":
        return message("expected the name of a file in the same folder")
    return refusal(fault, json=True)
