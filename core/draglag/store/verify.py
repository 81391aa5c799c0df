"""A session file checked against its schema and for plausibility."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from draglag.errors import DataError
from draglag.recording import OUTCOMES, PROTOCOLS, FloatArray, Run, Screen, Session, TouchTrace
from draglag.store.checksum import raw_checksum
from draglag.store.journal import UNFINISHED, all_losses, is_journal, open_journal, survey
from draglag.store.read import READERS, read_session
from draglag.store.safely import BROKEN, check_schema, open_hdf5, short, tree_problems


@dataclass(frozen=True)
class Finding:
    """``level``: "error" (the file is wrong) | "loss" (measured data are missing) | "warning" (look before use)."""

    level: str
    where: str
    text: str

    def __str__(self) -> str:
        return f"{self.level}: {self.where}: {self.text}"


def grade(findings: list[Finding]) -> str:
    """ "damaged" | "incomplete" (measured data are missing) | "sound"."""
    levels = {finding.level for finding in findings}
    return "damaged" if "error" in levels else "incomplete" if "loss" in levels else "sound"


def verify(path: Path | str) -> list[Finding]:
    """Faults of a session file or journal; does not raise."""
    path = Path(path)
    if is_journal(path):
        return _journal(path)
    findings: list[Finding] = []
    try:
        with open_hdf5(path) as file:
            version = check_schema(file, path)
            findings += [Finding("error", f"/{name}", problem) for name, problem in tree_problems(file)]
            if not findings:
                findings += _layout(file)
                findings += _checksums(file)
                findings += check_session(READERS[version](file))
    except DataError as error:
        findings.append(Finding("error", str(path), str(error).removeprefix(f"{path}: ")))
    except BROKEN as error:
        findings.append(Finding("error", str(path), f"is damaged ({short(error)})"))
    return findings


def _journal(path: Path) -> list[Finding]:
    try:
        with open_journal(path) as fd:
            found = survey(fd, str(path))
        findings = [Finding("loss", str(path), loss) for loss in all_losses(found)]
        return [Finding("loss", str(path), UNFINISHED), *findings, *check_session(read_session(path))]
    except DataError as error:
        return [Finding("error", str(path), str(error).removeprefix(f"{path}: "))]


def _layout(file: Any) -> list[Finding]:
    findings: list[Finding] = []

    def visit(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset):
            return
        if "units" not in item.attrs:
            findings.append(Finding("error", f"/{name}", "has no units"))
        if item.ndim == 1 and not item.is_scale and not len(item.dims[0]):
            findings.append(Finding("error", f"/{name}", "has no dimension scale"))

    file.visititems(visit)
    return findings


def _checksums(file: Any) -> list[Finding]:
    now = raw_checksum(file)
    if "raw_sha256" not in file.attrs:
        return [Finding("loss", "/", "was never closed: the recording was cut off")]
    findings = []
    if _text(file.attrs["raw_sha256"]) != now:
        findings.append(Finding("error", "/", "the raw data were changed after recording"))
    for name, group in file["analysis"].items() if "analysis" in file else ():
        if _text(group.attrs.get("input_sha256", "")) != now:
            findings.append(Finding("warning", f"/analysis/{name}", "was made from other raw data"))
    return findings


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def check_session(session: Session) -> list[Finding]:
    """Implausible or missing raw data."""
    findings: list[Finding] = []
    screen = session.screen
    if not (screen.width_mm > 0 and screen.height_mm > 0 and screen.width_px > 0 and screen.height_px > 0):
        findings.append(Finding("error", "screen", "its size is not positive"))
    if not session.stylus.diameter_mm > 0:
        findings.append(Finding("error", "stylus", "its diameter is not positive"))
    if not session.runs:
        findings.append(Finding("warning", "runs", "the session has no run"))
    for note in session.notes:
        if note.source == "salvage" and ";" in note.text:
            findings.append(Finding("loss", "notes", note.text))
    for run in session.runs:
        findings += [Finding(level, run.id, text) for level, text in _run(run, session)]
    return findings


def _run(run: Run, session: Session) -> list[tuple[str, str]]:
    found: list[tuple[str, str]] = []
    if run.protocol not in PROTOCOLS:
        found.append(("warning", f"unknown protocol “{run.protocol}”"))
    if run.outcome not in OUTCOMES:
        found.append(("warning", f"unknown outcome “{run.outcome}”"))
    elif run.outcome != "complete":
        found.append(("warning", f"ended as “{run.outcome}”"))
    found += [("loss", entry.text) for entry in run.log if entry.source == "file" and entry.level == "error"]
    touch, laser = run.touch, run.laser
    found += _times("touch", touch.t_s)
    found += _times("laser", laser.t_s)
    found += _positions(touch, session.screen)
    if touch.dropped or len(touch.gaps_s):
        found.append(("loss", f"touch: {touch.dropped} events dropped, {len(touch.gaps_s)} gaps"))
    if laser.missed or len(laser.gaps_s):
        found.append(("loss", f"laser: {laser.missed} edges missed, {len(laser.gaps_s)} gaps"))
    if not np.isin(laser.light, (0, 1)).all():
        found.append(("error", "laser levels other than 0 and 1"))
    return found


def _positions(touch: TouchTrace, screen: Screen) -> list[tuple[str, str]]:
    found: list[tuple[str, str]] = []
    if not (np.isfinite(touch.x_mm).all() and np.isfinite(touch.y_mm).all()):
        found.append(("error", "touch positions are not all finite"))
    outside = (touch.x_mm < -1) | (touch.x_mm > screen.width_mm + 1)
    outside |= (touch.y_mm < -1) | (touch.y_mm > screen.height_mm + 1)
    if outside.any():
        found.append(("warning", f"{int(outside.sum())} touch events lie outside the screen"))
    return found


def _times(stream: str, t_s: FloatArray) -> list[tuple[str, str]]:
    if not len(t_s):
        return [("warning", f"the {stream} stream is empty")]
    if not np.isfinite(t_s).all():
        return [("error", f"{stream} times are not all finite")]
    steps = np.diff(t_s)
    if (steps < 0).any():
        return [("error", f"{stream} times go back {int((steps < 0).sum())} times")]
    if (steps == 0).any():
        return [("warning", f"{int((steps == 0).sum())} {stream} times come twice")]
    return []
