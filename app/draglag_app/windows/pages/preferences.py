"""Preferences of the operator."""

from __future__ import annotations

import os
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QHBoxLayout,
    QLineEdit,
    QVBoxLayout,
    QWidget,
)

from draglag_app.windows.pages.parts.keys_panel import KeysPanel
from draglag_app.windows.parts.ask_files import ask_folder
from draglag_app.windows.parts.widgets import Form, Panel, button, label
from draglag_app.windows.start import folder_problem
from draglag_app.windows.workspace import Workspace


class PreferencesPage(QWidget):
    """Saves every change at once."""

    theme_chosen = Signal(str)

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        outer = QVBoxLayout(self)
        outer.setContentsMargins(16, 16, 16, 16)
        outer.setSpacing(12)
        appearance, form = _form(self.tr("Appearance"))
        self.theme = _choice((("dark", self.tr("Dark")), ("light", self.tr("Light")), ("system", self.tr("System"))))
        self.language = _choice((("system", self.tr("System")), ("en", "English"), ("nl", "Nederlands")))
        self.scale = _choice(tuple((value, f"{value:.0%}") for value in (1.0, 1.15, 1.3, 1.5, 1.75, 2.0)))
        form.row(self.tr("Theme"), self.theme)
        form.row(self.tr("Language (after a restart)"), self.language)
        form.row(self.tr("Size of text (after a restart)"), self.scale)
        self.motion = QCheckBox(self.tr("Reduced motion: nothing flashes or moves by itself"))
        form.row("", self.motion)
        outer.addWidget(appearance)
        work, form = _form(self.tr("Sessions"))
        self.folder = QLineEdit()
        self.folder.setAccessibleName(self.tr("Folder for sessions"))
        choose = button(self.tr("Choose…"))
        choose.clicked.connect(self._choose_folder)
        row = QHBoxLayout()
        row.setSpacing(8)
        row.addWidget(self.folder, 1)
        row.addWidget(choose)
        form.row(self.tr("Folder for sessions"), row)
        self.operator = QLineEdit()
        self.operator.setPlaceholderText(self.tr("your name, kept in every session"))
        form.row(self.tr("Operator"), self.operator)
        self.by_hand = QCheckBox(self.tr("Wait for F6 in every rest"))
        form.row("", self.by_hand)
        self.sound = QCheckBox(self.tr("Sound at the end of every run"))
        self.flash = QCheckBox(self.tr("Flash at the end of every run"))
        form.row("", self.sound)
        form.row("", self.flash)
        self.reopen = QCheckBox(self.tr("Open the last session when the window opens"))
        form.row("", self.reopen)
        self.reopen.clicked.connect(lambda on: workspace.change_settings(reopen=on))
        outer.addWidget(work)
        self.keys = KeysPanel(workspace)
        outer.addWidget(self.keys)
        where = self.tr("Settings are kept in {path}").format(path=workspace.settings_file)
        outer.addWidget(label(where, "hint", wrap=True))
        outer.addStretch(1)
        change = workspace.change_settings
        self.theme.activated.connect(lambda: self._theme_chosen())
        self.language.activated.connect(lambda: change(language=self.language.currentData()))
        self.scale.activated.connect(lambda: change(text_scale=self.scale.currentData()))
        self.folder.editingFinished.connect(
            lambda: self._changed("folder", os.path.expanduser(self.folder.text().strip()))
        )
        self.operator.editingFinished.connect(lambda: self._changed("operator", self.operator.text().strip()))
        self.by_hand.clicked.connect(lambda on: change(begin_by_hand=on))
        self.sound.clicked.connect(lambda on: change(sound=on))
        self.flash.clicked.connect(lambda on: change(flash=on))
        self.motion.clicked.connect(lambda on: change(reduced_motion=on))
        workspace.settings_changed.connect(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Show the settings."""
        settings = self._space.settings
        self.theme.setCurrentIndex(self.theme.findData(settings.theme))
        self.language.setCurrentIndex(self.language.findData(settings.language))
        self.scale.setCurrentIndex(max(0, self.scale.findData(settings.text_scale)))
        self.folder.setText(settings.folder)
        self.operator.setText(settings.operator)
        self.by_hand.setChecked(settings.begin_by_hand)
        self.reopen.setChecked(settings.reopen)
        self.sound.setChecked(settings.sound)
        self.flash.setChecked(settings.flash)
        self.motion.setChecked(settings.reduced_motion)

    def _theme_chosen(self) -> None:
        name = str(self.theme.currentData())
        self._space.change_settings(theme=name)
        self.theme_chosen.emit(name)

    def _changed(self, key: str, text: str) -> None:
        if text != getattr(self._space.settings, key) and (text or key == "operator"):
            self._space.change_settings(**{key: text})
            problem = folder_problem(Path(text)) if key == "folder" else ""
            self._space.noticed.emit("warning" if problem else "", problem)

    def _choose_folder(self) -> None:
        title, space = self.tr("Folder for sessions"), self._space
        ask_folder(self, title, self.folder.text(), lambda path: space.change_settings(folder=str(path)))


def _form(title: str) -> tuple[Panel, Form]:
    panel = Panel(title)
    form = Form()
    panel.body.addLayout(form)
    return panel, form


def _choice(rows: tuple[tuple[object, str], ...]) -> QComboBox:
    box = QComboBox()
    for value, text in rows:
        box.addItem(text, value)
    box.setMaximumWidth(280)
    return box
