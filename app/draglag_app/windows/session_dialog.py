"""Details of the next session."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QCheckBox, QDialog, QDialogButtonBox, QLineEdit, QVBoxLayout, QWidget

from draglag.errors import DataError, DraglagError
from draglag.protocol.presets import load_screen_file
from draglag_app.session.details import GIVEN, STANDARD, check_name, check_template
from draglag_app.windows.parts.finger_lists import raise_rows
from draglag_app.windows.parts.flow import Flow
from draglag_app.windows.parts.full_texts import ElidedBox, whole_text
from draglag_app.windows.parts.theme import wide
from draglag_app.windows.parts.widgets import Form, Scrolled, button, label, restyle
from draglag_app.windows.settings import PanelSettings
from draglag_app.windows.start import session_path
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.workspace import Workspace
from draglag_resources import presets

_WIDE_PX, _HIGH_PX = 560, 620
_NAME_PX = 150


class SessionDialog(QDialog):
    """Edits details in the settings; ``starts``: then begins a session."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None, starts: bool = False) -> None:
        super().__init__(parent)
        self._space = workspace
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowModality(Qt.WindowModality.WindowModal)
        self.setWindowTitle(self.tr("Session details"))
        settings = workspace.settings
        outer, column = QVBoxLayout(self), QVBoxLayout()
        form = self._form = Form()
        self.screen_box = ElidedBox(12)
        for name in presets("screens"):
            self.screen_box.addItem(f"{name}  ({load_screen_file(name).description})", name)
        self.screen_box.setCurrentIndex(max(0, self.screen_box.findData(settings.panel.preset)))
        whole_text(self.screen_box)
        form.row(self.tr("Screen"), self.screen_box)
        self.participant = self._line(self.tr("Participant code"), settings.participant)
        self.participant.setPlaceholderText(self.tr("a code, no name: P07"))
        self.session = self._line(self.tr("Session"), settings.session_label)
        self.operator = self._line(self.tr("Operator"), settings.operator)
        column.addLayout(form)
        self._free = QVBoxLayout()
        self.free: list[tuple[QLineEdit, QLineEdit]] = []
        for name, text in settings.fields.items():
            self._add_field(name, text)
        column.addLayout(self._free)
        self.more = button(self.tr("Add a field"))
        self.more.clicked.connect(lambda: self._add_field("", ""))
        row = Flow()
        row.addWidget(self.more)
        column.addLayout(row)
        name_form = Form()
        self.template = QLineEdit(settings.file_template)
        self.template.textChanged.connect(lambda text: self._preview())
        name_form.row(self.tr("File name"), self.template)
        column.addLayout(name_form)
        self.preview = label("", "hint", wrap=True)
        self.known = label("", "hint", wrap=True)
        column.addWidget(self.preview)
        column.addWidget(self.known)
        self.ask = QCheckBox(self.tr("Ask before every session"))
        self.ask.setChecked(settings.ask_details)
        column.addWidget(self.ask)
        column.addStretch(1)
        outer.addWidget(Scrolled(column), 1)
        self.buttons = self._buttons(starts)
        outer.addWidget(self.buttons)
        room = self.screen().availableGeometry().size()
        self.resize(min(wide(_WIDE_PX), room.width()), min(wide(_HIGH_PX), room.height()))
        raise_rows(self)
        self.participant.setFocus()
        self._preview()

    def _buttons(self, starts: bool) -> QDialogButtonBox:
        made = QDialogButtonBox(QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel)
        if starts:
            made.button(QDialogButtonBox.StandardButton.Ok).setText(self.tr("Start"))
        made.accepted.connect(self._keep)
        made.rejected.connect(self.reject)
        return made

    def _line(self, title: str, text: str) -> QLineEdit:
        line = QLineEdit(text)
        line.textChanged.connect(lambda text: self._preview())
        self._form.row(title, line)
        return line

    def _add_field(self, name: str, text: str) -> None:
        pair = QLineEdit(name), QLineEdit(text)
        row = Flow()
        for line, what, shown in zip(
            pair,
            (self.tr("Name of the field"), self.tr("Text of the field")),
            (self.tr("name: handedness"), self.tr("text: left")),
            strict=True,
        ):
            line.setAccessibleName(what)
            line.setPlaceholderText(shown)
            line.setMinimumWidth(wide(_NAME_PX))
            line.textChanged.connect(lambda text: self._preview())
        row.addWidget(pair[0])
        row.add_growing(pair[1])
        self._free.addLayout(row)
        self.free.append(pair)
        if not name:
            pair[0].setFocus()

    def _changes(self) -> dict[str, object]:
        fields = {
            check_name(name.text().strip()): text.text().strip() for name, text in self.free if name.text().strip()
        }
        template = check_template(self.template.text().strip(), fields)
        return {
            "participant": self.participant.text().strip(),
            "session_label": self.session.text().strip(),
            "operator": self.operator.text().strip(),
            "fields": fields,
            "file_template": template,
            "ask_details": self.ask.isChecked(),
        }

    def _preview(self) -> None:
        if not hasattr(self, "buttons"):
            return
        given = [name.text().strip() for name, _ in self.free]
        names = " ".join(f"{{{name}}}" for name in (*STANDARD, *GIVEN, *filter(None, given)))
        self.known.setText(self.tr("Fields for the name: {names}").format(names=names))
        try:
            settings = self._space.settings.model_copy(update=self._changes())
            screen = load_screen_file(str(self.screen_box.currentData())).name
            path = session_path(settings, self._space.protocol.name, screen)
            said = self.tr("Saved as {name} in {folder}")
            self.preview.setText(said.format(name=path.name, folder=path.parent))
            problem = ""
        except DraglagError as error:
            problem = in_words(error.message)
            problem = problem[:1].upper() + problem[1:]
            self.preview.setText(problem)
        restyle(self.preview, "level", "bad" if problem else "")
        self.buttons.button(QDialogButtonBox.StandardButton.Ok).setEnabled(not problem)

    def _keep(self) -> None:
        try:
            changes = self._changes()
        except DataError:
            return  # said in the preview
        preset = str(self.screen_box.currentData())
        if preset != self._space.settings.panel.preset:
            stylus_mm = load_screen_file(preset).stylus.diameter_mm
            changes["panel"] = PanelSettings(preset=preset, stylus_mm=stylus_mm)
        self._space.change_settings(**changes)
        self.accept()
