"""The window's top bar."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QWidget

from draglag_app.session import events
from draglag_app.session.details import STANDARD
from draglag_app.windows.parts.full_texts import ElidedLabel
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.parts.theme import wide
from draglag_app.windows.parts.widgets import Light, button, label, restyle
from draglag_app.windows.wording import words
from draglag_app.windows.wording.library_words import fault_words, in_words, source_name
from draglag_app.windows.workspace import Workspace
from draglag_devices.addresses import ROLES

_HELP_PX = 44
_LOW_BYTES = 1_000_000_000


class Header(QFrame):
    """Device lights, session, clock, free disk."""

    lights_changed = Signal()

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("header")
        self.setFixedHeight(56)
        self._space = workspace
        row = QHBoxLayout(self)
        row.setContentsMargins(16, 0, 16, 0)
        row.setSpacing(8)
        self.session = ElidedLabel("sessionName")
        row.addWidget(self.session, 1)
        self.simulated = label(self.tr("SIMULATED"), "simulated")
        self.simulated.setToolTip(self.tr("No touchscreen was measured: instruments or session are simulated."))
        row.addWidget(self.simulated, 0, Qt.AlignmentFlag.AlignVCenter)
        row.addSpacing(10)
        self.lights: dict[str, Light] = {}
        names = {"touch": self.tr("touch"), "laser": self.tr("laser"), "walt": self.tr("WALT")}
        for role in ROLES:
            light = self.lights[role] = Light()
            row.addWidget(light)
            row.addWidget(label(names[role], "headerFact"))
            row.addSpacing(10)
        self.disk = label("", "headerFact")
        self.clock = label("", "headerFact")
        row.addSpacing(10)
        row.addWidget(self.disk)
        row.addSpacing(14)
        row.addWidget(self.clock)
        self.help = button("?", tip=self.tr("The manual on this page (Shift+F1)"))
        self.help.setAccessibleName(self.tr("The manual on this page (Shift+F1)"))
        self.help.setFixedWidth(wide(_HELP_PX))
        row.addSpacing(8)
        row.addWidget(self.help)
        bridge = workspace.bridge
        bridge.device_opened.connect(lambda event: self.set_light(event.role, "live", in_words(event.description)))
        bridge.device_fault.connect(self._fault)
        bridge.notice_raised.connect(self._lost_or_back)
        bridge.disk_status.connect(lambda event: self._show_disk(event.free_bytes))
        workspace.recording.began.connect(lambda order: self._show_name())
        workspace.recording.ended.connect(lambda path, problem: self._ended())
        workspace.session_changed.connect(self._show_name)
        workspace.settings_changed.connect(self._rig_changed)
        self._rig = dict.fromkeys(ROLES, "")
        self._timer = QTimer(self)
        self._timer.setInterval(1000)
        self._timer.timeout.connect(self._tick)
        self._timer.start()
        self._ticks = 0
        self.show_rig()
        self._show_name()
        self._tick()

    def set_light(self, role: str, state: str, tip: str) -> None:
        """Show a device's state: "off", "ready", "live", "warning" or "fault"."""
        self.lights[role].set_state(state)
        self.lights[role].setToolTip(plain(tip))
        self.lights[role].setAccessibleName(f"{source_name(role)}: {state}")
        self.lights_changed.emit()

    def faults(self) -> list[str]:
        """The chosen instruments' known faults."""
        rig = self._space.settings.rig
        lights = ((role, self.lights[role]) for role in ROLES if getattr(rig, role))
        return [f"{source_name(role)}: {light.toolTip()}" for role, light in lights if light.state == "fault"]

    def show_rig(self) -> None:
        """Show the chosen rig as unchecked."""
        if self._space.recording.active:
            return
        rig = self._space.settings.rig
        for role in ROLES:
            address = self._rig[role] = getattr(rig, role)
            if not address:
                missing = role != "walt"
                self.set_light(role, "fault" if missing else "off", self.tr("no address chosen"))
            elif address.startswith("sim:"):
                self.set_light(role, "ready", self.tr("simulated"))
            else:
                self.set_light(role, "warning", self.tr("{address}: not checked yet").format(address=address))

    def _rig_changed(self) -> None:
        rig = self._space.settings.rig
        if any(getattr(rig, role) != self._rig[role] for role in ROLES):
            self.show_rig()

    def _fault(self, event: events.DeviceFault) -> None:
        self.set_light(event.role, "fault", fault_words(event.problem, event.remedy))

    def _ended(self) -> None:
        live = [role for role, light in self.lights.items() if light.state == "live"]
        self.show_rig()
        for role in live:
            if self.lights[role].state == "warning":  # not simulated
                self.set_light(role, "ready", self.tr("answered in the last session"))
        self._show_name()

    def _lost_or_back(self, event: events.NoticeRaised) -> None:
        if event.state and event.source in self.lights:
            self.set_light(event.source, "live" if event.state == "back" else "fault", in_words(event.text))

    def _show_name(self) -> None:
        self.simulated.setVisible(self._space.simulated)
        recording = self._space.recording
        if recording.active and recording.order is not None:
            options = recording.order.options
            self.session.setText("● " + recording.order.out.name + _about(options.screen.name, options.details))
        elif self._space.session is not None:
            file = f"  ({self._space.path.name})" if self._space.path else ""
            session = self._space.session
            self.session.setText(session.name + file + _about(session.screen.name, session.details))
        else:
            self.session.setText(self.tr("No session"))

    def _tick(self) -> None:
        self.clock.setText(datetime.now().strftime("%H:%M:%S"))
        if self._ticks % 10 == 0:
            folder = Path(self._space.settings.folder)
            while not folder.exists() and folder != folder.parent:
                folder = folder.parent
            try:
                self._show_disk(shutil.disk_usage(folder).free)
            except OSError:
                self.disk.setText("")
        self._ticks += 1

    def _show_disk(self, free_bytes: int) -> None:
        self.disk.setText(self.tr("{size} free").format(size=words.size(free_bytes)))
        restyle(self.disk, "alarm", "true" if free_bytes < _LOW_BYTES else "false")


def _about(screen: str, details: Mapping[str, str]) -> str:
    """Screen, then the details: those that every session has by their text alone, free fields with their name."""
    known = [details[name] for name in STANDARD if details.get(name)]
    free = [f"{words.detail_name(name)}: {text}" for name, text in details.items() if name not in STANDARD and text]
    return "".join(f" · {text}" for text in (screen, *known, *free))
