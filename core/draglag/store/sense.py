"""Plausibility of a session's times."""

from __future__ import annotations

import numpy as np

from draglag.errors import DataError
from draglag.messages import message
from draglag.recording import FloatArray, Run, Session

# No stream reaches further than this beyond its run: devices start before it and report up to some seconds late.
MARGIN_S = 600.0
REMEDY = message("Use an untouched copy of the file; draglag verify lists all that is wrong")


def check_times(session: Session, where: str) -> Session:
    """The session. Raises DataError for impossible times."""
    for run in session.runs:
        if not np.isfinite([run.start_s, run.duration_s]).all():
            raise DataError(
                message("{path}: {run}: its beginning or duration is no number", path=where, run=run.id), REMEDY
            )
        shown = () if run.display is None else (("display", run.display.t_s),)
        for stream, t_s in (("touch", run.touch.t_s), ("laser", run.laser.t_s), *shown):
            problem = first_problem(stream, t_s, run)
            if problem:
                raise DataError(message("{path}: {run}: {problem}", path=where, run=run.id, problem=problem), REMEDY)
    return session


def first_problem(stream: str, t_s: FloatArray, run: Run) -> str:
    """The first sample of impossible time, as a sentence."""
    t_s = np.asarray(t_s)
    bad = np.flatnonzero(~np.isfinite(t_s))
    if bad.size:
        return message("the time of {stream} sample {sample} is no number", stream=stream, sample=bad[0])
    far = np.abs(t_s - run.start_s) > max(run.duration_s, 0.0) + MARGIN_S
    if far.any():
        k = int(np.flatnonzero(far)[0])
        return message(
            "{stream} sample {sample} has a time of {t_s:g} s, the run began at {start_s:g} s",
            stream=stream,
            sample=k,
            t_s=t_s[k],
            start_s=run.start_s,
        )
    back = np.flatnonzero(np.diff(t_s) < 0)
    if back.size:
        k = int(back[0]) + 1
        return message(
            "{stream} sample {sample} goes back in time, from {before_s:.6f} to {t_s:.6f} s",
            stream=stream,
            sample=k,
            before_s=t_s[k - 1],
            t_s=t_s[k],
        )
    return ""
