"""Bench: the instruments in use."""

from __future__ import annotations

from dataclasses import replace
from html import escape
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QCheckBox, QComboBox, QGridLayout, QHBoxLayout, QTextBrowser, QVBoxLayout, QWidget

from draglag.errors import DraglagError
from draglag_app.preflight import Check, preflight
from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.full_texts import ElidedBox, whole_text, widen_list
from draglag_app.windows.parts.tasks import Progress, Task
from draglag_app.windows.parts.widgets import Light, Panel, Resting, button, label
from draglag_app.windows.recording.session_thread import display_choices
from draglag_app.windows.settings import PanelSettings
from draglag_app.windows.wording.check_words import check_html, light_of, summary
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.workspace import Workspace
from draglag_devices.addresses import ROLES
from draglag_devices.discovery import SIMULATED, Found, discover
from draglag_devices.rig import make_rig

# Drifts of clocks need longer; this is for whether all is in place.
_WATCH_S = 3.0
# As wide as a screen's name asks for, where there is room.
_DISPLAY_PX = 380


def check_devices(addresses: dict[str, str], panel: PanelSettings, folder: Path, progress: Progress) -> list[Check]:
    """Every check of the rig, as ``draglag check``; a wrong address is a fault of its device alone."""
    wrong, usable = [], {}
    for role, address in addresses.items():
        try:
            make_rig({role: address}, panel.preset)
            usable[role] = address
        except DraglagError as error:
            wrong.append(Check(role, "fault", error.problem, remedy=error.remedy))
    if not usable:
        return wrong
    found = preflight(usable, panel.screen(), panel.preset, _WATCH_S, folder, lambda share: progress(share, ""))
    return [*found, *wrong]


def _entry(found: Found) -> str:
    return f"{found.address}  {in_words(found.description)}"


class BenchPage(QWidget):
    """A row per role; this computer's devices."""

    checked = Signal(object)
    asks = Signal(str)

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        self._found: list[Found] = []
        self._checking: Task | None = None
        self._judged = False  # whether the list shows a check of the instruments in use
        self._shown: dict[str, str] = {}  # role → the address that its light and its words are about
        outer = QVBoxLayout(self)
        outer.setContentsMargins(16, 16, 16, 16)
        outer.setSpacing(12)
        self.welcome = self._welcome()
        outer.addWidget(self.welcome)
        outer.addWidget(self._instruments())
        outer.addWidget(self._surroundings())
        outer.addWidget(self._others(), 1)
        workspace.settings_changed.connect(self.refresh)
        workspace.tasks.changed.connect(self._tasks_changed)
        self.refresh()

    def _welcome(self) -> Panel:
        panel = Panel(self.tr("Welcome"))
        text = self.tr("No instruments are chosen yet. Try everything on the simulated rig, or choose yours below.")
        panel.body.addWidget(label(text, "medium", wrap=True))
        row = QHBoxLayout()
        self.use_simulated = button(self.tr("Use the simulated rig"), "primary", large=True)
        self.use_simulated.clicked.connect(self._simulate)
        later = button(self.tr("Use my own instruments"), large=True)
        later.clicked.connect(lambda: self._space.change_settings(first_start=False))
        row.addWidget(self.use_simulated)
        row.addWidget(later)
        row.addStretch(1)
        panel.body.addLayout(row)
        return panel

    def _instruments(self) -> Panel:
        panel = Panel(self.tr("Instruments"))
        grid = QGridLayout()
        grid.setHorizontalSpacing(12)
        grid.setVerticalSpacing(10)
        grid.setColumnStretch(3, 1)
        self.boxes: dict[str, QComboBox] = {}
        self.lights: dict[str, Light] = {}
        self.words = {}
        names = {"touch": self.tr("Touchscreen"), "laser": self.tr("Laser sensor"), "walt": self.tr("WALT (taps)")}
        for row, role in enumerate(ROLES):
            self.lights[role] = Light()
            box = self.boxes[role] = QComboBox()
            box.setEditable(True)
            box.setMinimumContentsLength(32)
            box.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
            box.setAccessibleName(names[role])
            box.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
            box.activated.connect(lambda index, role=role: self._address_chosen(role))
            box.addItem(_entry(SIMULATED))  # there without looking
            box.setCurrentIndex(-1)
            whole_text(box)
            edit = box.lineEdit()
            if edit is not None:
                edit.setPlaceholderText(self.tr("not used"))
                edit.setAccessibleName(names[role])
                edit.editingFinished.connect(lambda role=role: self._address_chosen(role))
            self.words[role] = label("", "hint", wrap=True)
            grid.addWidget(self.lights[role], row, 0)
            grid.addWidget(label(names[role]), row, 1)
            grid.addWidget(box, row, 2)
            grid.addWidget(self.words[role], row, 3)
        panel.body.addLayout(grid)
        return panel

    def _surroundings(self) -> Panel:
        panel = Panel()
        row = Flow(10)
        row.addWidget(label(self.tr("Participant sees the target")))
        self.display = ElidedBox(12)
        self.display.setAccessibleName(self.tr("Participant sees the target"))
        for value, text in display_choices():
            self.display.addItem(text, value)
        whole_text(self.display)
        self.display.activated.connect(self._display_chosen)
        self.display.setMaximumWidth(_DISPLAY_PX)
        row.add_growing(self.display)
        self.fast = QCheckBox(self.tr("Simulated time, as fast as possible"))
        self.fast.clicked.connect(lambda on: self._change_rig(fast=on))
        row.addWidget(self.fast)
        row.add_rest()
        look = button(self.tr("Look for devices"))
        look.clicked.connect(self.look)
        self.check_button = button(self.tr("Check the rig  F3"), "primary")
        self.check_button.clicked.connect(self.check)
        self._resting = Resting(self.check_button)
        row.add_together(look, self.check_button)
        panel.body.addLayout(row)
        return panel

    def _others(self) -> Panel:
        panel = self._findings = Panel(self.tr("On this computer"))
        self.list = QTextBrowser()
        self.list.setAccessibleName(self.tr("On this computer"))
        hint = self.tr("Look for devices lists what is here, and what to do where something is missing.")
        self.list.setPlaceholderText(hint)
        panel.body.addWidget(self.list)
        return panel

    # --- what is chosen -------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Show the settings."""
        settings = self._space.settings
        self.welcome.setVisible(settings.first_start and not settings.rig.addresses())
        for role in ROLES:
            address = getattr(settings.rig, role)
            self.boxes[role].setEditText(address)
            if self._shown.get(role) == address:
                continue  # what a check found still holds
            self._shown[role] = address
            if not address:
                needed = role != "walt"
                self.lights[role].set_state("fault" if needed else "off")
                self.words[role].setText(
                    self.tr("Needed: choose an address.") if needed else self.tr("Only for taps; may stay empty.")
                )
            elif address.startswith("sim:"):
                self.lights[role].set_state("ready")
                self.words[role].setText(self.tr("simulated"))
            else:
                self.lights[role].set_state("warning")
                self.words[role].setText(self.tr("Not checked yet: F3."))
        self.display.setCurrentIndex(max(0, self.display.findData(settings.rig.display)))
        self.fast.setChecked(settings.rig.fast)
        self.fast.setEnabled(settings.rig.simulated)

    def _change_rig(self, **changes: object) -> None:
        rig = self._space.settings.rig.model_copy(update=changes)
        before = self._space.settings.rig
        if rig != before:
            self._space.change_settings(rig=rig, first_start=False)
        if rig.addresses() != before.addresses() and self._judged:
            self._judged = False  # what was checked is in use no longer
            self._list(self.tr("On this computer"), [])
            self._space.noticed.emit("", "")

    def _simulate(self) -> None:
        self._change_rig(touch="sim:", laser="sim:", walt="sim:")

    def _address_chosen(self, role: str) -> None:
        text = self.boxes[role].currentText().split("  ")[0].strip()
        changes: dict[str, object] = {role: text}
        if not text.startswith(("sim:", "replay:", "csv:")) and text:
            changes["fast"] = False
        self._change_rig(**changes)

    def _display_chosen(self) -> None:
        self._change_rig(display=self.display.currentData())

    # --- looking --------------------------------------------------------------------------------------------

    def look(self) -> None:
        """List the devices of this computer."""
        self._space.tasks.start(
            self.tr("Looking for devices"), lambda progress: discover(), self._discovered, self._say
        )

    def _discovered(self, found: list[Found]) -> None:
        self._found = found
        for role, box in self.boxes.items():
            text = box.currentText()
            box.clear()
            box.addItems([_entry(one) for one in found if role in one.roles])
            box.setEditText(text)
            widen_list(box)
        rows = []
        for device in found:
            state = "✓" if device.usable else "✕"
            line = f"<b>{state} {escape(device.address)}</b> &nbsp; {escape(in_words(device.description))}"
            rows.append(line + (f"<br>&nbsp;&nbsp;&nbsp;→ {escape(in_words(device.remedy))}" if device.remedy else ""))
        self._list(self.tr("On this computer"), rows)

    def _list(self, title: str, rows: list[str]) -> None:
        self._findings.title.setText(title)
        self.list.setAccessibleName(title)
        self.list.setHtml("<br>".join(rows))

    def check(self) -> None:
        """Check every chosen device."""
        rig, panel = self._space.settings.rig, self._space.settings.panel
        addresses = rig.addresses()
        if not addresses:
            self._say(self.tr("There is nothing to check: choose the instruments first."))
            return
        self._resting.rest()
        if not self._space.settings.rig.simulated:  # nobody draws on a simulated one
            self._space.noticed.emit("info", self.tr("Watching the rig: draw on the screen and through the beam."))
        folder = Path(self._space.settings.folder)
        self._checking = self._space.tasks.start(
            self.tr("Checking the rig"),
            lambda progress: check_devices(addresses, panel, folder, progress),
            lambda checks: self._devices_checked(list(addresses), checks),
            self._say,
        )

    def _devices_checked(self, roles: list[str], checks: list[Check]) -> None:
        lights = [light_of(role, checks) for role in roles]
        results = [replace(light, text=in_words(light.text)) for light in lights]
        for result in results:
            self.lights[result.role].set_state(result.state)
            self.words[result.role].setText(result.text)
        self._list(self.tr("Check of the rig"), [check_html(check) for check in checks])
        self._judged = True
        self.checked.emit(results)
        self._space.noticed.emit(*summary(checks))

    def _tasks_changed(self) -> None:
        """The check is over, by itself or cancelled."""
        if self._checking is None or self._checking in self._space.tasks.running:
            return
        if self._checking.cancelled:
            self._space.noticed.emit("", "")
        self._checking = None
        self.check_button.setEnabled(True)
        self._resting.give_focus_back()

    def _say(self, text: str) -> None:
        self._space.noticed.emit("warning", text)
