"""Calibration files of touchscreens."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from draglag.errors import DataError, cause
from draglag.instruments.calibration import AffineFit
from draglag.messages import message
from draglag.reading import parse_json, read_text
from draglag.reading.limits import DOCUMENT_BYTES, SIZE_MM
from draglag.recording import TouchCalibration
from draglag.system.temporary import new_file
from draglag.touch_events.frames import Mapping2D

_FORMAT = "draglag-touch-calibration"
_TOUCHES = ("x_raw", "y_raw", "x_mm", "y_mm")
_REMEDY = message("calibrate again")
# An offset undoes what the axes count: 32 bits of 1 mm each, the coarsest unit, and more than that is no map.
_LARGEST = 2.0**32


def as_mapping(fit: AffineFit) -> Mapping2D:
    """The fit as a function of raw positions."""
    return Mapping2D(*(float(value) for value in fit.matrix.ravel()))


def save_calibration(fit: AffineFit, path: Path, device: str = "", made: TouchCalibration | None = None) -> None:
    """Write a fit, and the touches it was ``made`` from. Raises DataError.

    ``device``: the touchscreen; without one the file serves any.
    """
    content: dict[str, object] = {
        "format": _FORMAT,
        "version": 1,
        "device": device,
        "matrix": fit.matrix.tolist(),
        "residual_mm": fit.residual_mm.tolist(),
        "rms_mm": fit.rms_mm,
    }
    if made is not None:
        content["made_utc"] = made.made_utc
        content["touches"] = {name: getattr(made, name).tolist() for name in _TOUCHES}
    try:
        with new_file(path, replace=True) as growing:
            growing.write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    except OSError as error:
        raise DataError(
            message("{path}: cannot be written ({why})", path=path, why=cause(error)), "choose another place"
        ) from None


def load_calibration(path: Path) -> tuple[AffineFit, str]:
    """A saved fit and its touchscreen's name. Raises DataError."""
    content = _read(path)
    try:
        matrix = np.array(content["matrix"], np.float64).reshape(2, 3)
        residual = np.array(content["residual_mm"], np.float64).reshape(-1, 2)
        rms = float(content["rms_mm"])
    except (KeyError, TypeError, ValueError):
        raise DataError(
            message("{path}: lacks the matrix or the residuals of a calibration", path=path), _REMEDY
        ) from None
    if not (np.isfinite(residual).all() and 0 <= rms <= SIZE_MM):
        raise DataError(message("{path}: its residuals are no lengths", path=path), _REMEDY)
    if not (np.abs(matrix) <= _LARGEST).all() or abs(np.linalg.det(matrix[:, :2])) == 0:
        raise DataError(message("{path}: maps the whole screen onto a line or nowhere", path=path), _REMEDY)
    return AffineFit(matrix, residual, rms), str(content.get("device", ""))


def load_touches(path: Path) -> TouchCalibration:
    """A saved calibration; touches are empty where the file has none. Raises DataError."""
    fit, device = load_calibration(path)
    content = _read(path)
    touches = content.get("touches", dict.fromkeys(_TOUCHES, ()))
    try:
        x_raw, y_raw, x_mm, y_mm = (np.array(touches[name], np.float64).reshape(-1) for name in _TOUCHES)
    except (KeyError, TypeError, ValueError):
        raise DataError(message("{path}: its touches are not columns of numbers", path=path), _REMEDY) from None
    columns = (x_raw, y_raw, x_mm, y_mm)
    if len({len(column) for column in columns}) > 1 or not all(np.isfinite(column).all() for column in columns):
        raise DataError(message("{path}: its touches do not match one to one", path=path), _REMEDY)
    return TouchCalibration(x_raw, y_raw, x_mm, y_mm, fit.matrix, device, str(content.get("made_utc", "")))


def _read(path: Path) -> dict[str, Any]:
    content = parse_json(read_text(path, DOCUMENT_BYTES, message("check the path")), path, _REMEDY)
    if not isinstance(content, dict) or content.get("format") != _FORMAT or content.get("version") != 1:
        raise DataError(message("{path}: is not a calibration of version 1", path=path), _REMEDY)
    return content
