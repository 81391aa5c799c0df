"""``draglag record``."""

from __future__ import annotations

import importlib
import re
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any, cast

import click

from draglag.errors import DataError, DraglagError
from draglag.messages import message
from draglag.protocol.presets import load_screen_file
from draglag.protocol.runs import Protocol, load_protocol
from draglag.recording import Screen, Stylus, TouchCalibration
from draglag.store import clear_leftovers
from draglag.system.packages import advice, need
from draglag_app.cli.common import FiniteRange, Seed
from draglag_app.cli.window import WINDOW_MODULES, need_display
from draglag_app.session import Control, Display, OffscreenDisplay, SessionOptions, events, run_session
from draglag_app.session.details import parse_details
from draglag_devices.addresses import parse_address
from draglag_devices.calibration import as_mapping, load_calibration, load_touches
from draglag_devices.rig import Rig, give_calibration, make_rig
from draglag_devices.sim.world import World

SIMULATED = ("sim", "replay", "csv")
_OnScreen = Callable[[int, Callable[[Display], Path], Screen, Control], Path]
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_ON_SCREEN = "draglag_app.windows.participant.screen_display"


@click.command("record")
@click.argument("protocol")
@click.argument("screen_number", required=False)
@click.option("--touch", required=True, metavar="ADDRESS", help="The touchscreen, e.g. evdev:/dev/input/event5.")
@click.option("--laser", metavar="ADDRESS", help="The laser sensor, e.g. ethercat:eth1?channel=1.")
@click.option("--walt", metavar="ADDRESS", help="The WALT, for taps, e.g. serial:/dev/ttyACM0.")
@click.option("--display", default="offscreen", show_default=True, metavar="(screen N|offscreen)",
              help="Where the participant sees the target.")  # fmt: skip
@click.option("--out", required=True, type=click.Path(path_type=Path), help="The session file to make.")
@click.option("--screen", "screen_name", metavar="NAME", help="Preset or TOML file of the screen under test.")
@click.option("--seed", type=Seed(), help="Of the order of runs and of the simulation.")
@click.option("--fast/--realtime", "fast", default=None,
              help="Simulated or replayed sources: as fast as the computer allows, or in real time.")  # fmt: skip
@click.option("--calibration", type=click.Path(path_type=Path), metavar="FILE.json",
              help="Of the touchscreen, saved on the Geometry page of the window.")  # fmt: skip
@click.option("--stylus-mm", type=FiniteRange(min=0, min_open=True), help="Diameter of the stylus.")
@click.option("--note", default="", help="The operator's words for the file.")
@click.option("--detail", "details", multiple=True, metavar="NAME=TEXT",
              help="Kept in the file and the report: participant=P07, operator=…; may be repeated.")  # fmt: skip
@click.option("--spare", type=click.Path(path_type=Path, exists=True, file_okay=False), metavar="FOLDER",
              help="Where the session goes on when the place of --out is full or gone.")  # fmt: skip
@click.option("--lsl", is_flag=True, help="Also as streams of the Lab Streaming Layer: touch, laser and markers.")
def record(
    protocol: str,
    screen_number: str | None,
    touch: str,
    laser: str | None,
    walt: str | None,
    display: str,
    out: Path,
    screen_name: str | None,
    seed: int | None,
    fast: bool | None,
    calibration: Path | None,
    stylus_mm: float | None,
    note: str,
    details: tuple[str, ...],
    spare: Path | None,
    lsl: bool,
) -> None:
    """Record PROTOCOL (a preset's name or a TOML file) into a new session file.

    \b
    Examples:
        draglag record latency-sweep --touch evdev:/dev/input/event5 --laser ethercat:eth1?channel=1 \\
            --display screen 2 --screen screen-1 --out session.h5
        draglag record latency-sweep --touch evdev:/dev/input/event5 --laser ethercat:eth1?channel=1 \\
            --calibration touchscreen.json --display screen 2 --screen screen-1 --out session.h5 --spare /media/stick
        draglag record demo --touch sim: --laser sim: --walt sim: --display offscreen --out session.h5
    """
    number = display_number(display, screen_number)
    plan = load_protocol(protocol)
    addresses = {role: text for role, text in (("touch", touch), ("laser", laser), ("walt", walt)) if text}
    parsed = [parse_address(text) for text in addresses.values()]
    if fast is None and number is None and not any("speed" in address.options for address in parsed):
        # Nobody watches and nothing real takes part: there is nothing to wait for.
        fast = all(address.scheme in SIMULATED for address in parsed)
    if screen_name is None:
        screen_name = next((a.options.get("screen", "screen-1") for a in parsed if a.scheme == "sim"), None)
    if screen_name is None:
        raise DataError("which screen is under test is not known", "add --screen NAME (a preset or a TOML file)")
    rig = make_rig(addresses, screen_name, plan.seed if seed is None else seed, fast)
    options = session_options(rig, screen_name, seed, stylus_mm, note)
    options = replace(options, details=parse_details(details))
    if calibration is not None:
        options = replace(options, calibration=calibrated(rig, touch, calibration))
    if out.absolute().parent.is_dir():
        clear_leftovers(out.absolute().parent)
    path = record_with(plan, rig, number, out, options, spare, lsl)
    click.echo(f"{path}: saved")


def display_number(display: str, screen_number: str | None) -> int | None:
    """Number of the participant's screen, from 1; None for offscreen. Raises click.UsageError."""
    words = re.fullmatch(r"screen[ :=-]?(\d*)", display)
    if display == "offscreen" and screen_number is None:
        return None
    digits = (words.group(1) or screen_number or "1") if words else ""
    if not digits.isdecimal() or int(digits) < 1:
        raise click.UsageError("--display takes 'screen N' (N = 1, 2 …) or 'offscreen'")
    return int(digits)


def session_options(
    rig: Rig, screen_name: str, seed: int | None, stylus_mm: float | None = None, note: str = ""
) -> SessionOptions:
    """Session options; stylus and beam are the simulated world's, if any. Raises DataError."""
    preset = load_screen_file(screen_name)
    screen = Screen(preset.name, **preset.screen.model_dump())
    stylus, beam = Stylus(preset.stylus.diameter_mm), None
    world = rig.stage.players.get("sim")
    if isinstance(world, World):
        stylus, beam = world.rig.stylus, world.rig.beam
    if stylus_mm is not None:
        stylus = Stylus(stylus_mm)
    return SessionOptions(screen, stylus, beam, seed, note=note)


def calibrated(rig: Rig, touch: str, path: Path) -> TouchCalibration:
    """A saved calibration, given to the touchscreen. Raises DataError."""
    fit, device = load_calibration(path)
    if "calibration" in parse_address(touch).options:
        raise DataError(
            message("{touch}: the address brings a calibration of its own", touch=touch), "give one of the two"
        )
    if not give_calibration(rig, as_mapping(fit), device, fit.rms_mm):
        raise DataError(
            message("{touch}: only a touchscreen (evdev:…) takes a calibration", touch=touch), "omit --calibration"
        )
    return load_touches(path)


def record_with(
    protocol: Protocol,
    rig: Rig,
    number: int | None,
    out: Path,
    options: SessionOptions,
    spare: Path | None = None,
    lsl: bool = False,
) -> Path:
    """The path of a recorded session. Raises DraglagError, also when it ended early.

    ``spare``: folder to continue in when ``out`` is full or gone. ``lsl``: also stream to the Lab Streaming Layer.
    """
    problem = ""
    notify = progress_printer()
    if lsl:
        from draglag_app.lsl import lsl_listener

        notify = lsl_listener(f"{socket.gethostname()} {out.name}", notify)

    def listener(event: events.Event) -> None:
        nonlocal problem
        if isinstance(event, events.SessionFinished):
            problem = event.problem
        notify(event)

    control = Control(spare=spare)

    def measure(display: Display) -> Path:
        return run_session(protocol, rig, display, out, options, listener, control)

    with stop_on_signals(control):
        if number is None:
            path = measure(OffscreenDisplay())
        else:
            path = _on_screen(number)(number, measure, options.screen, control)
    if problem:
        raise DataError(
            message("the session is not whole: {problem}", problem=problem),
            message("what was recorded is in {path}", path=path),
        )
    return path


def _on_screen(number: int) -> _OnScreen:
    need(*WINDOW_MODULES)
    need_display()
    try:
        module = importlib.import_module(_ON_SCREEN)
    except ModuleNotFoundError as missing:
        if not (missing.name or "").startswith("draglag_app.windows"):
            problem, remedy = advice(missing.name or "")
            raise DraglagError(
                message("screen {number} cannot be drawn on: {problem}", number=number, problem=problem), remedy
            ) from None
        raise DraglagError("drawing on a screen is not built in this version", "use --display offscreen") from None
    return cast(_OnScreen, module.record_on_screen)


@contextmanager
def stop_on_signals(control: Control) -> Iterator[None]:
    """The first SIGINT, SIGTERM or SIGHUP ends the session properly; a second SIGINT acts as usual."""
    before: dict[signal.Signals, Any] = {}

    def stop(number: int, frame: FrameType | None) -> None:
        control.stop()
        if number == signal.SIGINT:
            signal.signal(signal.SIGINT, before[signal.SIGINT])

    try:
        for number in _ENDING:
            # nohup asks that a closed terminal changes nothing.
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, stop)
    except ValueError:  # not the main thread: whoever owns that one hears them
        yield
        return
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def progress_printer() -> events.Listener:
    """A listener that prints runs and warnings on stderr."""
    quiet = not sys.stderr.isatty()
    numbers: dict[str, str] = {}

    def notify(event: events.Event) -> None:
        if isinstance(event, events.StateChanged):
            numbers[event.run_id] = f"{event.run_number}/{event.run_count}"
        elif isinstance(event, events.NoticeRaised) and (event.level != "info" or event.state):
            click.echo(f"{event.source}: {event.text}", err=True)
        elif isinstance(event, events.DeviceFault):
            click.echo(f"{event.role}: {event.problem} {event.remedy}", err=True)
        elif isinstance(event, events.RunFinished) and not quiet:
            run = event.run
            speed = "" if run.nominal_speed_mm_s is None else f" {run.nominal_speed_mm_s:.0f} mm/s"
            click.echo(
                f"{numbers.get(run.id, '')} {run.id} {run.protocol}{speed}: {event.outcome}, "
                f"{len(run.touch.t_s)} touch events, {len(run.laser.t_s)} edges",
                err=True,
            )

    return notify
