"""From settings to a recording."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QCoreApplication

from draglag.errors import DraglagError
from draglag.protocol.runs import Protocol
from draglag.recording import Screen, TouchCalibration
from draglag_app.session import SessionOptions
from draglag_app.session.details import file_name, session_name
from draglag_app.windows.participant.placement import axes_problem, shape_problem
from draglag_app.windows.participant.screen_display import numbered_screen
from draglag_app.windows.recording.session_thread import Order
from draglag_app.windows.settings import Settings
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.workspace import Workspace
from draglag_devices.calibration import as_mapping
from draglag_devices.rig import Rig, give_calibration, make_rig
from draglag_devices.sim.world import World


def tr(text: str) -> str:
    return QCoreApplication.translate("Start", text)


@dataclass(frozen=True)
class Obstacle:
    """What prevents measuring.

    Attributes:
        page: where it is resolved.
        short, sentence: what to do.
        hopeless: nothing can be recorded before.
    """

    page: str
    short: str
    sentence: str
    hopeless: bool = False


def obstacles(space: Workspace) -> list[Obstacle]:
    """Obstacles, the first to resolve first."""
    rig, protocol = space.settings.rig, space.protocol
    found = []
    names = {"touch": tr("touchscreen"), "laser": tr("laser")}
    missing = [name for role, name in names.items() if protocol.runs and not getattr(rig, role)]
    if missing:
        devices = tr("{one} and {other}").format(one=missing[0], other=missing[1]) if missing[1:] else missing[0]
        short = tr("choose {devices}").format(devices=devices)
        sentence = tr(
            "No {devices} chosen: press Look for devices on the page Bench, then choose from the lists."
        ).format(devices=devices)
        found.append(Obstacle("bench", short, sentence, True))
    if protocol.taps is not None and not rig.walt and rig.addresses():
        sentence = tr(
            "The protocol has taps, but no WALT is chosen: taps would be skipped. Choose it under WALT (taps) on the "
            "page Bench."
        )
        found.append(Obstacle("bench", tr("choose a WALT for the taps"), sentence, not protocol.runs))
    if not rig.addresses() and not found:
        sentence = tr(
            "No instruments are chosen: press Look for devices on the page Bench, then choose from the lists."
        )
        found.append(Obstacle("bench", tr("choose the instruments"), sentence, True))
    turned = [Obstacle("geometry", tr("check the screen"), sentence) for sentence in _misplaced(space)]
    unwritable = folder_problem(Path(space.settings.folder))
    if unwritable:
        found.append(Obstacle("preferences", tr("choose another folder"), unwritable, True))
    return found + turned


def folder_problem(folder: Path) -> str:
    """Why no session can be saved there, as far as can be seen without writing; else empty."""
    folder = folder.absolute()
    there = next((one for one in (folder, *folder.parents) if os.path.lexists(one)), folder)  # the rest is made
    if there.is_dir() and os.access(there, os.W_OK | os.X_OK):
        return ""
    sentence = tr("Nothing can be saved in {folder}: choose another folder for sessions on the page Preferences.")
    return sentence.format(folder=folder)


def _misplaced(space: Workspace) -> list[str]:
    settings = space.settings
    if settings.rig.touch.startswith("sim:") or not settings.rig.display.startswith("screen"):
        return []  # nobody's hand follows the target, and the simulated panel cannot be changed
    try:
        shown_on = numbered_screen(int(settings.rig.display.split()[-1]))
        panel = settings.touched_screen()
    except DraglagError:
        return []  # reported when the session begins
    made = settings.panel.calibration
    calibrated = (made is not None and made.serves(settings.rig.touch)) or "calibration=" in settings.rig.touch
    axes = "" if settings.rig.simulated else axes_problem(calibrated, shown_on)
    return [problem for problem in (shape_problem(panel, shown_on), axes) if problem]


def make_order(space: Workspace) -> Order:
    """The order by settings and protocol. Raises DraglagError."""
    settings, protocol = space.settings, space.protocol
    rig = make_rig(
        settings.rig.addresses(), settings.panel.preset, protocol.seed, settings.rig.fast and settings.rig.simulated
    )
    screen, stylus, beam = settings.panel.screen(), settings.panel.stylus(), settings.panel.beam()
    world = rig.stage.players.get("sim")
    if isinstance(world, World):
        # The simulated world has a panel, a beam and a stylus of its own.
        screen, stylus, beam = world.rig.screen, world.rig.stylus, world.rig.beam
    calibration = _calibrate(rig, settings, screen)
    options = SessionOptions(screen, stylus, beam, calibration=calibration)
    # From here on the name is data: it stays in the language that it was given in.
    name = in_words(session_name(protocol.name, screen.name))
    options = replace(options, details=settings.details(), name=name)
    return Order(
        with_source(protocol), rig, session_path(settings, protocol.name, screen.name),
        options, settings.rig.display, auto=not settings.begin_by_hand,
    )  # fmt: skip


def session_path(settings: Settings, protocol: str, screen: str) -> Path:
    """Where a session that begins now would be saved. Raises DataError."""
    folder, now = Path(settings.folder), datetime.now()
    details = dict.fromkeys(settings.fields, "") | settings.details()  # the template may name a field left empty
    return file_name(folder, settings.file_template, protocol, screen, details, now)


def _calibrate(rig: Rig, settings: Settings, screen: Screen) -> TouchCalibration | None:
    made = settings.panel.calibration
    used = made if made is not None and made.serves(settings.rig.touch) else None
    if used is None:
        return None
    fit = used.fit(screen)
    give_calibration(rig, as_mapping(fit), used.device, fit.rms_mm)
    return used.recorded(screen)


def with_source(protocol: Protocol) -> Protocol:
    """The protocol with its TOML text."""
    from draglag_app.windows.protocol_text import to_toml

    return protocol.model_copy(update={"source": to_toml(protocol)})
