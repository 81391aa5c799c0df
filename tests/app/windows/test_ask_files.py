"""Asking for files: where the dialog begins, what a name becomes, what is never replaced unasked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from draglag_app.windows.parts.ask_files import ask_new_folder, ask_open, ask_save, start_folder


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> dict[str, Path | None]:
    """What the operator types, and where the dialog began."""
    reported: dict[str, Path | None] = {"typed": None, "started": None}

    def pick(parent: None, title: str, start: Path, kind: str, mode: object, then: Callable) -> None:
        reported["started"] = start
        if reported["typed"] is not None:
            then([reported["typed"]])

    monkeypatch.setattr("draglag_app.windows.parts.ask_files.pick_files", pick)
    return reported


def test_a_dialog_begins_in_a_folder_that_is_there(tmp_path: Path, answers: dict[str, Path | None]) -> None:
    (tmp_path / "there").mkdir()
    assert start_folder(tmp_path / "there" / "not" / "yet") == str(tmp_path / "there")
    assert start_folder(tmp_path / "there") == str(tmp_path / "there")
    got: list[Path] = []
    ask_open(None, "", tmp_path / "gone", "", got.append)
    assert got == []
    assert answers["started"] == tmp_path


def test_a_name_gets_the_ending_it_needs_and_nothing_is_replaced_unasked(
    tmp_path: Path, answers: dict[str, Path | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, Callable[[], None]]] = []
    monkeypatch.setattr("draglag_app.windows.parts.ask_files.ask_whether", lambda parent, *more: asked.append(more))
    start, got = tmp_path / "mine.toml", []
    for typed, becomes in (("a", "a.toml"), ("a.toml", "a.toml"), ("v1.2", "v1.2.toml")):
        answers["typed"] = tmp_path / typed
        ask_save(None, "", start, "", got.append)
        assert got.pop() == tmp_path / becomes
    assert asked == []
    (tmp_path / "a.toml").write_text("")
    for typed in ("a", "a.toml"):
        answers["typed"] = tmp_path / typed
        ask_save(None, "", start, "", got.append)
        assert got == []
        text, yes = asked.pop()
        assert "a.toml exists already" in text
        yes()
        assert got.pop() == tmp_path / "a.toml"
    answers["typed"] = None
    ask_save(None, "", start, "", got.append)
    assert got == []


def test_a_folder_to_write_into_need_not_be_there(tmp_path: Path, answers: dict[str, Path | None]) -> None:
    answers["typed"], got = tmp_path / "new", []
    ask_new_folder(None, "", tmp_path / "session-report", got.append)
    assert got == [tmp_path / "new"]
    assert answers["started"] == tmp_path / "session-report"
