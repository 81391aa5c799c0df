"""From the settings and the protocol to a recording: what stands in the way, and the order itself."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QCoreApplication

from draglag.errors import DraglagError
from draglag.protocols import Protocol
from draglag.recording import Screen, TouchCalibration
from draglag_app.session import SessionOptions
from draglag_app.windows.participant.placement import axes_problem, shape_problem
from draglag_app.windows.participant.screen_display import numbered_screen
from draglag_app.windows.recording.session_thread import Order
from draglag_app.windows.settings import Settings
from draglag_app.windows.workspace import Workspace
from draglag_devices.calibration import as_mapping
from draglag_devices.rig import Rig, give_calibration, make_rig
from draglag_devices.sim.world import World


def tr(text: str) -> str:
    return QCoreApplication.translate("Start", text)


def obstacles(space: Workspace) -> tuple[list[str], bool]:
    """What stands in the way, a sentence each, and whether nothing can be recorded because of it."""
    rig, protocol = space.settings.rig, space.protocol
    problems, hopeless = [], False
    for role, name in (("touch", tr("touchscreen")), ("laser", tr("laser sensor"))):
        if protocol.runs and not getattr(rig, role):
            problems.append(tr("No {device} is chosen: choose one on the Bench page.").format(device=name))
            hopeless = True
    if protocol.taps is not None and not rig.walt and rig.addresses():
        problems.append(tr("The protocol has taps, but no WALT is chosen: taps would be skipped."))
        hopeless = hopeless or not protocol.runs
    if not rig.addresses() and not problems:
        problems.append(tr("No instruments are chosen: choose them on the Bench page."))
        hopeless = True
    return [*problems, *_misplaced(space)], hopeless


def _misplaced(space: Workspace) -> list[str]:
    """What is wrong with the participant's screen, as far as the desktop knows."""
    settings = space.settings
    if not settings.rig.display.startswith("screen"):
        return []
    try:
        shown_on = numbered_screen(int(settings.rig.display.split()[-1]))
        panel = settings.touched_screen()
    except DraglagError:
        return []  # told when the session begins
    made = settings.panel.calibration
    calibrated = (made is not None and made.serves(settings.rig.touch)) or "calibration=" in settings.rig.touch
    axes = "" if settings.rig.simulated else axes_problem(calibrated, shown_on)
    return [problem for problem in (shape_problem(panel, shown_on), axes) if problem]


def make_order(space: Workspace) -> Order:
    """What the settings and the protocol ask for. Raises DraglagError."""
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
    if settings.operator:
        options = replace(options, note=tr("Operator: {name}").format(name=settings.operator))
    return Order(
        with_source(protocol), rig, file_name(Path(settings.folder), protocol.name, screen.name),
        options, settings.rig.display, auto=not settings.begin_by_hand,
    )  # fmt: skip


def _calibrate(rig: Rig, settings: Settings, screen: Screen) -> TouchCalibration | None:
    """Tell the touchscreen its calibration, where the operator made one. Raises EstimateError."""
    made = settings.panel.calibration
    used = made if made is not None and made.serves(settings.rig.touch) else None
    if used is None:
        return None
    fit = used.fit(screen)
    give_calibration(rig, as_mapping(fit), used.device, fit.rms_mm)
    return used.recorded(screen)


def file_name(folder: Path, protocol: str, screen: str) -> Path:
    """A name that is not taken yet: date, protocol, screen."""
    stem = "-".join(re.sub(r"[^\w.-]+", "_", part) for part in (protocol, screen))
    stem = f"{datetime.now():%Y-%m-%d_%H%M%S}_{stem}"
    path, k = folder / f"{stem}.h5", 2
    while path.exists() or path.with_name(path.name + ".partial").exists():
        path, k = folder / f"{stem}-{k}.h5", k + 1
    return path


def with_source(protocol: Protocol) -> Protocol:
    """The protocol with the TOML text that belongs to it, for the session file."""
    from draglag_app.windows.protocol_text import to_toml

    return protocol.model_copy(update={"source": to_toml(protocol)})
