"""Asking for files: where the dialog begins, what a name becomes, what is never replaced unasked."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication, QFileDialog, QMessageBox, QWidget

from draglag_app.windows.ask_files import ask_new_folder, ask_open, ask_save, start_folder


@pytest.fixture
def answers(qapp: QApplication, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """What the operator types, and what the dialogs were called with."""
    told = {"typed": "", "started": ""}

    def ask(parent: QWidget | None, title: str, start: str, *more: object) -> tuple[str, str]:
        told["started"] = start
        return told["typed"], ""

    monkeypatch.setattr(QFileDialog, "getSaveFileName", ask)
    monkeypatch.setattr(QFileDialog, "getOpenFileName", ask)
    return told


def test_a_dialog_begins_in_a_folder_that_is_there(tmp_path: Path, answers: dict[str, str]) -> None:
    (tmp_path / "there").mkdir()
    assert start_folder(tmp_path / "there" / "not" / "yet") == str(tmp_path / "there")
    assert start_folder(tmp_path / "there") == str(tmp_path / "there")
    assert ask_open(None, "", tmp_path / "gone", "") is None
    assert answers["started"] == str(tmp_path)


def test_a_name_gets_the_ending_it_needs_and_nothing_is_replaced_unasked(
    tmp_path: Path, answers: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def question(parent: QWidget | None, title: str, text: str, **more: object) -> object:
        asked.append(text)
        return more["defaultButton"]

    monkeypatch.setattr(QMessageBox, "question", question)
    start = tmp_path / "mine.toml"
    for typed, becomes in (("a", "a.toml"), ("a.toml", "a.toml"), ("v1.2", "v1.2.toml")):
        answers["typed"] = str(tmp_path / typed)
        assert ask_save(None, "", start, "") == tmp_path / becomes
    assert asked == []
    (tmp_path / "a.toml").write_text("")
    answers["typed"] = str(tmp_path / "a")
    assert ask_save(None, "", start, "") is None
    assert "a.toml exists already" in asked[0]
    answers["typed"] = ""
    assert ask_save(None, "", start, "") is None


def test_a_folder_to_write_into_need_not_be_there(tmp_path: Path, answers: dict[str, str]) -> None:
    answers["typed"] = str(tmp_path / "new")
    assert ask_new_folder(None, "", tmp_path / "session-report") == tmp_path / "new"
    assert answers["started"] == str(tmp_path / "session-report")
