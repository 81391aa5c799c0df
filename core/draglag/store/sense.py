"""Whether the times of a session make sense: checked once, on reading, before anything is computed from them."""

from __future__ import annotations

import numpy as np

from draglag.errors import DataError
from draglag.recording import FloatArray, Run, Session

# No stream reaches further than this beyond its run: devices start before it and report up to some seconds late.
MARGIN_S = 600.0
REMEDY = "Use an untouched copy of the file; draglag verify lists all that is wrong"


def check_times(session: Session, where: str) -> Session:
    """The session itself. Raises DataError naming run and sample where times are no numbers, go back or are absurd."""
    for run in session.runs:
        if not np.isfinite([run.start_s, run.duration_s]).all():
            raise DataError(f"{where}: {run.id}: its beginning or duration is no number", REMEDY)
        shown = () if run.display is None else (("display", run.display.t_s),)
        for stream, t_s in (("touch", run.touch.t_s), ("laser", run.laser.t_s), *shown):
            problem = first_problem(stream, t_s, run)
            if problem:
                raise DataError(f"{where}: {run.id}: {problem}", REMEDY)
    return session


def first_problem(stream: str, t_s: FloatArray, run: Run) -> str:
    """The first sample whose time cannot be right, in words; empty where all can."""
    t_s = np.asarray(t_s)
    bad = np.flatnonzero(~np.isfinite(t_s))
    if bad.size:
        return f"the time of {stream} sample {bad[0]} is no number"
    far = np.abs(t_s - run.start_s) > max(run.duration_s, 0.0) + MARGIN_S
    if far.any():
        k = int(np.flatnonzero(far)[0])
        return f"{stream} sample {k} has a time of {t_s[k]:g} s, the run began at {run.start_s:g} s"
    back = np.flatnonzero(np.diff(t_s) < 0)
    if back.size:
        k = int(back[0]) + 1
        return f"{stream} sample {k} goes back in time, from {t_s[k - 1]:.6f} to {t_s[k]:.6f} s"
    return ""
