"""What an export omits."""

from __future__ import annotations

from draglag.recording import Session


def left_out(session: Session, kind: str) -> tuple[str, ...]:
    """What of this session a format ("exchange", "csv", "netcdf", "mat") omits."""
    if kind != "csv":
        return ()
    runs = session.runs
    held_columns = {
        "screen": True,
        "stylus": True,
        "clock comparisons": bool(session.clocks) or any(run.sync for run in runs),
        "device clock of the laser": any(len(run.laser.device_t_s) or len(run.laser.epoch) for run in runs),
        "what the display showed": any(run.display is not None for run in runs),
        "gaps": any(len(trace.gaps_s) for run in runs for trace in (run.touch, run.laser)),
        "touch axes": any(run.touch.axes for run in runs),
        "calibration": session.calibration is not None,
        "beam": session.beam is not None,
        "devices": bool(session.devices),
        "participant, operator and other details": bool(session.details),
        "target parameters": any(run.target for run in runs),
        "protocol": bool(session.protocol_toml),
        "seeds": session.seed is not None or any(run.seed is not None for run in runs),
        "name, start and software": True,
        "notes and logs": bool(session.notes) or any(run.log for run in runs),
        "counts of rejected taps": session.taps is not None and bool(session.taps.rejected),
    }
    return tuple(what for what, there in held_columns.items() if there)
