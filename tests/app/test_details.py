"""Participant, session, operator, free fields: in the file, in every export, in the report, in the file's name."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path

import h5py
import pytest
from click.testing import CliRunner

from core.store_sessions import full_session
from draglag.errors import DataError
from draglag.exchange import read_exchange, write_exchange
from draglag.store import read_session, write_session
from draglag_app.cli.record import record
from draglag_app.session.details import TEMPLATE, check_template, file_name, parse_details

NOW = datetime(2026, 11, 24, 9, 5, 7)
DETAILS = {"participant": "P07", "session": "2", "operator": "Zoë", "handedness": "left"}


def test_details_reach_file_and_exchange_folder(tmp_path: Path, session) -> None:
    session = replace(session, details=DETAILS)
    path = tmp_path / "a.h5"
    write_session(session, path)
    assert read_session(path).details == DETAILS
    with h5py.File(path) as file:
        assert file["details"].attrs["participant"].decode() == "P07"
    write_exchange(session, tmp_path / "folder")
    assert read_exchange(tmp_path / "folder").details == DETAILS


def test_the_template_names_the_file(tmp_path: Path) -> None:
    name = file_name(tmp_path, "{participant}_{session}_{protocol}", "quick", "screen-1", DETAILS, NOW)
    assert name.name == "P07_2_quick.h5"
    name.touch()
    assert (
        file_name(tmp_path, "{participant}_{session}_{protocol}", "quick", "s", DETAILS, NOW).name == "P07_2_quick-2.h5"
    )
    assert file_name(tmp_path, TEMPLATE, "quick", "screen-1", {}, NOW).name == "2026-11-24_090507_quick-screen-1.h5"
    # Nothing known of the participant: no separators in a row.
    assert file_name(tmp_path, "{participant}_{session}_{protocol}", "quick", "s", {}, NOW).name == "quick.h5"


@pytest.mark.parametrize("hostile", ["../../etc/{participant}", "a/b", "{participant}\0"])
def test_a_name_stays_in_its_folder(tmp_path: Path, hostile: str) -> None:
    for participant in ("P07", "../../x", "a/b\\c"):
        path = file_name(tmp_path, hostile, "quick", "s", {"participant": participant}, NOW)
        assert path.parent == tmp_path
        assert "/" not in path.name
        assert not path.name.startswith(".")


@pytest.mark.parametrize("wrong", ["{nobody}", "{participant", "{participant.__class__}", "{participant:99}", "  "])
def test_a_template_that_names_nothing_is_refused(wrong: str) -> None:
    with pytest.raises(DataError):
        check_template(wrong)


@pytest.mark.parametrize("wrong", ["P07", "2nd=x", "date=today", "my field=x"])
def test_a_detail_that_is_none_is_refused_with_the_remedy(wrong: str) -> None:
    with pytest.raises(DataError, match=r"Write NAME=TEXT|Use letters"):
        parse_details([wrong])


def test_record_keeps_details(tmp_path: Path) -> None:
    out = tmp_path / "taps.h5"
    words = ["taps-100", "--touch", "sim:", "--walt", "sim:", "--display", "offscreen", "--out", str(out)]
    result = CliRunner().invoke(record, [*words, "--detail", "participant=P07", "--detail", "operator=Zoë"])
    assert result.exit_code == 0, result.output
    assert read_session(out).details == {"participant": "P07", "operator": "Zoë"}


@pytest.fixture
def session():
    return full_session()
