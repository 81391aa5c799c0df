"""Calibrations of touchscreens as small files, and as mappings for the drivers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from draglag.calibration import AffineFit
from draglag.errors import DataError
from draglag_devices.touch.frames import Mapping2D

_FORMAT = "draglag-touch-calibration"


def as_mapping(fit: AffineFit) -> Mapping2D:
    """The fit as the mapping the decoder applies."""
    return Mapping2D(*(float(value) for value in fit.matrix.ravel()))


def save_calibration(fit: AffineFit, path: Path, device: str = "") -> None:
    """Write a fit with its residuals. ``device``: name of the touchscreen. Raises DataError."""
    content = {
        "format": _FORMAT,
        "version": 1,
        "device": device,
        "matrix": fit.matrix.tolist(),
        "residual_mm": fit.residual_mm.tolist(),
        "rms_mm": fit.rms_mm,
    }
    try:
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise DataError(f"{path}: cannot be written ({error.strerror})", "choose another place") from None


def load_calibration(path: Path) -> tuple[AffineFit, str]:
    """A saved fit and the name of its touchscreen. Raises DataError."""
    remedy = "calibrate again"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})", "check the path") from None
    except ValueError:
        raise DataError(f"{path}: is not a calibration", remedy) from None
    if not isinstance(content, dict) or content.get("format") != _FORMAT or content.get("version") != 1:
        raise DataError(f"{path}: is not a calibration of version 1", remedy)
    try:
        matrix = np.array(content["matrix"], np.float64).reshape(2, 3)
        residual = np.array(content["residual_mm"], np.float64).reshape(-1, 2)
        rms = float(content["rms_mm"])
    except (KeyError, TypeError, ValueError):
        raise DataError(f"{path}: lacks the matrix or the residuals of a calibration", remedy) from None
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:, :2])) == 0:
        raise DataError(f"{path}: maps the whole screen onto a line or nowhere", remedy)
    return AffineFit(matrix, residual, rms), str(content.get("device", ""))
