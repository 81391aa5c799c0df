"""A whole session."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import draglag
from draglag.errors import DataError, message_of
from draglag.messages import chained, message
from draglag.protocol.runs import Protocol, expand
from draglag.recording import LogEntry, Session
from draglag.store import SessionWriter
from draglag_app.session import events
from draglag_app.session.conductor import RUN_ROLES, TAP_ROLES, Conductor
from draglag_app.session.control import Control
from draglag_app.session.details import session_name
from draglag_app.session.display import Display
from draglag_app.session.options import SessionOptions
from draglag_app.session.place import close, elsewhere
from draglag_app.session.readers import open_all
from draglag_app.session.recorder import Recorder
from draglag_devices.rig import Rig, give_panel
from draglag_devices.source import DeviceError, SourceInfo


def run_session(
    protocol: Protocol,
    rig: Rig,
    display: Display,
    out: Path,
    options: SessionOptions,
    listener: events.Listener = lambda event: None,
    control: Control | None = None,
) -> Path:
    """The path of a new, closed session file with a recorded protocol.

    Args:
        rig: not yet open; runs need the roles "touch" and "laser", taps "touch" and "walt".
        listener: called with every event, from two threads.
        control: requests from other threads.

    When the session ends early, the file has what was recorded; ``SessionFinished.problem`` says why.

    Raises:
        OpenFaults: nothing was written.
        DataError: the file cannot be written (the rest is in ``.partial``), or a target does not fit the screen.
    """
    plan = expand(protocol, options.screen, options.seed, beam=options.beam)
    roles = {source.role for source in rig.sources}
    _check_roles(protocol, roles)
    if out.exists():
        raise DataError(message("{path}: exists already and is not overwritten", path=out), "Choose another name")
    give_panel(rig.sources, options.screen)
    infos = open_all(rig.sources)
    try:
        for info in infos.values():
            listener(events.DeviceOpened(info.role, info.address, info.description))
        writer = SessionWriter(out, _header(protocol, rig, options, infos))
    except BaseException:
        for source in rig.sources:
            source.close()
        raise
    recorder = Recorder(rig.sources, writer, listener)
    control = control or Control()
    conductor = Conductor(protocol, rig, display, options, listener, control, recorder)
    conductor.axes = infos["touch"].axes if "touch" in infos else ()
    finished = False
    try:
        recorder.start()
        conductor.run_plan(plan)
        finished = True
    finally:
        rig.stage.stop()
        recorder.stop()
        display.hide()
        if not finished:
            writer.abandon()
    path = _finish(recorder, writer, control, listener)
    listener(events.SessionFinished(path, conductor.problem))
    return path


def _finish(recorder: Recorder, writer: SessionWriter, control: Control, listener: events.Listener) -> Path:
    failure = recorder.saver.failure
    try:
        if failure is not None and not control.has_place:
            raise elsewhere(failure, writer.partial)
        return close(writer, control, listener)
    except DataError as error:
        writer.abandon()
        listener(events.SessionFinished(writer.partial, message_of(error)))
        raise


def _check_roles(protocol: Protocol, roles: set[str]) -> None:
    needed = set(RUN_ROLES if protocol.runs else ()) | set(TAP_ROLES if protocol.taps and not protocol.runs else ())
    missing = [role for role in ("touch", "laser", "walt") if role in needed - roles]
    if missing:
        raise DeviceError(
            message("protocol '{protocol}'", protocol=protocol.name),
            message(
                "needs a {roles} source",
                roles=chained("{before} and a {next}", (message("{role}", role=role) for role in missing)),
            ),
            message("add {options}", options=" ".join(f"--{role} ADDRESS" for role in missing)),
        )


def _header(protocol: Protocol, rig: Rig, options: SessionOptions, infos: dict[str, SourceInfo]) -> Session:
    now_s = rig.stage.time_base.now()
    notes = (LogEntry(now_s, "note", "operator", options.note),) if options.note else ()
    return Session(
        name=options.name or str(session_name(protocol.name, options.screen.name)),
        screen=options.screen,
        stylus=options.stylus,
        runs=(),
        beam=options.beam,
        started_utc=datetime.now(UTC).isoformat(timespec="microseconds"),
        started_s=now_s,
        clock="host CLOCK_MONOTONIC, seconds" if rig.stage.time_base.realtime else "simulated clock, seconds",
        notes=notes,
        details=dict(options.details),
        protocol_toml=protocol.source,
        seed=protocol.seed if options.seed is None else options.seed,
        devices={role: f"{info.address} · {info.description}" for role, info in infos.items()},
        software=f"draglag {draglag.__version__}",
        calibration=options.calibration,
    )
