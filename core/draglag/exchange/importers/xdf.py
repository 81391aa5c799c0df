"""XDF files of the Lab Streaming Layer: stamps on the recorder's clock, not smoothed."""

from __future__ import annotations

import importlib
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from draglag.errors import DataError
from draglag.exchange.importers.columns import LASER_DEFAULTS, TOUCH_DEFAULTS, ColumnMap, laser_of, touch_of
from draglag.exchange.importers.xdf_chunks import sound_chunks
from draglag.messages import message
from draglag.reading.files import plain_bytes
from draglag.recording import FloatArray, LaserTrace, Screen, TouchTrace
from draglag.system.packages import advice

# Of one file, in the session's notes: one or two a stream are usual.
_MOST_WARNINGS = 20
_REMEDY = message(
    "Name the stream with --map stream=NAME (touch) and --map laser.stream=NAME, and its channels by label, or by "
    "number from 0, with x=LABEL …"
)


def read_xdf(
    path: Path, how: ColumnMap, screen: Screen | None, units_per_mm: float | None, said: list[str]
) -> tuple[TouchTrace, LaserTrace | None]:
    """The touch, and the laser if present; ``said`` receives warnings. Raises DataError, also without pyxdf."""
    streams = _streams(path, said)
    chosen = how.names(("x", "y", "contact", "device_t"), TOUCH_DEFAULTS)
    touch = _find(streams, how.streams.get("stream"), [name for name, _ in chosen.values()])
    if touch is None:
        raise _no_touch(path, streams, how, [name for key, (name, _) in chosen.items() if key in how.columns])
    by_key = {key: _channel(touch, name, path) for key, (name, _) in chosen.items()}
    by_key["t"] = _stamps(touch)
    units = {"t": "s"} | {key: unit for key, (_, unit) in chosen.items()}
    trace = touch_of(by_key, units, f"{path}, stream {_name(touch)}", screen, units_per_mm)
    column, unit = how.names(("laser.light",), LASER_DEFAULTS)["laser.light"]
    laser = _find(streams, how.streams.get("laser.stream"), [column])
    if laser is None and "laser.stream" in how.streams:
        raise DataError(
            message(
                "{path}: holds no stream {stream} with the channel {column}",
                path=path,
                stream=how.streams["laser.stream"],
                column=column,
            ),
            _REMEDY,
        )
    if laser is None:
        return trace, None
    where = f"{path}, stream {_name(laser)}"
    return trace, laser_of(_stamps(laser), _channel(laser, column, path), "s", unit, where)


def _streams(path: Path, said: list[str]) -> list[dict[str, Any]]:
    try:
        pyxdf: Any = importlib.import_module("pyxdf")
    except ModuleNotFoundError as missing:
        raise DataError(*advice(missing.name or "")) from missing
    chunks = sound_chunks(plain_bytes(path), str(path))
    if chunks.damaged:
        said.append(f"{chunks.damaged} pieces of the file are damaged or cut off; what they held is missing")
    try:
        with _heard("pyxdf", said), np.errstate(all="ignore"):
            streams, _ = pyxdf.load_xdf(BytesIO(chunks.data), synchronize_clocks=True, dejitter_timestamps=False)
    except Exception as error:  # pyxdf raises whatever it stumbles over
        what = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise DataError(
            message("{path}: is not a sound XDF file ({what})", path=path, what=what), "Copy it again"
        ) from error
    return [one for one in streams if len(one["time_stamps"])]


@contextmanager
def _heard(library: str, said: list[str]) -> Iterator[None]:
    logger, handler = logging.getLogger(library), logging.Handler(logging.WARNING)
    before = logger.propagate
    warnings: list[str] = []
    handler.emit = lambda record: warnings.append(f"{library}: {record.getMessage()}")  # type: ignore[method-assign]
    logger.addHandler(handler)
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.propagate = before
        said += warnings[:_MOST_WARNINGS]


def _find(streams: list[dict[str, Any]], name: str | None, labels: list[str]) -> dict[str, Any] | None:
    fitting = [one for one in streams if all(_index(one, label) is not None for label in labels)]
    if name is not None:
        fitting = [one for one in fitting if _name(one) == name]
    return fitting[0] if fitting else None


def _no_touch(path: Path, streams: list[dict[str, Any]], how: ColumnMap, mapped: list[str]) -> DataError:
    """That a channel that was mapped is in no stream of that name, else that there is no touch."""
    asked = [one for one in streams if _name(one) == how.streams.get("stream", _name(one))]
    lacking = [label for label in mapped if all(_index(one, label) is None for one in asked)]
    if asked and lacking:
        names = ", ".join(map(_described, asked))
        problem = message("{path}: no channel {label} in {names}", path=path, label=lacking[0], names=names[:300])
        return DataError(problem, _REMEDY)
    names = ", ".join(map(_described, streams)) or "no stream"
    return DataError(message("{path}: holds no stream of touch; it has {names}", path=path, names=names[:300]), _REMEDY)


def _described(stream: dict[str, Any]) -> str:
    channels = ", ".join(_labels(stream)) or ", ".join(map(str, range(stream["time_series"].shape[1])))
    return f"{_name(stream)} ({channels})"


def _channel(stream: dict[str, Any], label: str, path: Path) -> FloatArray:
    index = _index(stream, label)
    if index is None:
        raise DataError(
            message("{path}, stream {stream}: has no channel {label}", path=path, stream=_name(stream), label=label),
            _REMEDY,
        )
    return np.asarray(stream["time_series"][:, index], np.float64)


def _index(stream: dict[str, Any], label: str) -> int | None:
    labels = _labels(stream)
    if label in labels:
        number = labels.index(label)
    else:
        number = int(label) if label.isdecimal() and len(label) < 6 else -1
    return number if 0 <= number < stream["time_series"].shape[1] else None


def _stamps(stream: dict[str, Any]) -> FloatArray:
    return np.asarray(stream["time_stamps"], np.float64)


def _name(stream: dict[str, Any]) -> str:
    return str(stream["info"]["name"][0])


def _labels(stream: dict[str, Any]) -> list[str]:
    try:
        channels = stream["info"]["desc"][0]["channels"][0]["channel"]
        return [str(channel["label"][0]) for channel in channels]
    except (LookupError, TypeError):
        return []
