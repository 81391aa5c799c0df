"""The committed schemas are those of the code, and what draglag really writes conforms to them."""

from __future__ import annotations

import copy
import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import jsonschema
import pytest
from click.testing import CliRunner

from core.store_sessions import bare_session, full_run, full_session
from draglag.exchange import write_exchange
from draglag.schemas.make import files, schemas
from draglag.schemas.session_file import layout_of
from draglag.simulation import simulate_session
from draglag.store import add_analysis, write_session
from draglag_app.cli.main import cli

DOCS = Path(__file__).parents[3] / "docs"


@pytest.mark.parametrize("name", list(files()))
def test_what_is_committed_is_what_the_code_says(name: str) -> None:
    assert (DOCS / name).read_text("utf-8") == files()[name], "run ./run schemas"


def conforms(name: str, value: Any) -> None:
    schema = schemas()[name]
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(value, schema)
    # A schema that takes anything says nothing.
    changed = copy.deepcopy(value)
    changed[next(iter(schema["required"]))] = []
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(changed, schema)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("schemas") / "s.h5"
    return write_session(simulate_session("screen-1", "demo", seed=2), path)


def printed(*arguments: object) -> Any:
    done = CliRunner().invoke(cli, [*map(str, arguments), "--json"])
    assert done.exit_code == 0, done.stderr
    return json.loads(done.stdout)


def test_analyze_compare_and_models(session: Path, tmp_path: Path) -> None:
    conforms("analyze", printed("analyze", session, "--save-model", tmp_path / "m.json"))
    other = shutil.copy(session, tmp_path / "other.h5")
    conforms("compare", printed("compare", session, other))
    conforms("model", json.loads((tmp_path / "m.json").read_text("utf-8")))


def test_gap(session: Path) -> None:
    conforms("gap", printed("gap", session, "--max-effects", "1"))


def test_exchange_folders(tmp_path: Path) -> None:
    folder = write_exchange(full_session(), tmp_path / "x")
    conforms("exchange", json.loads((folder / "session.json").read_text("utf-8")))


@pytest.mark.parametrize("whole", [True, False])
def test_session_files(tmp_path: Path, whole: bool) -> None:
    path = write_session(full_session() if whole else bare_session(full_run("r", 0.0)), tmp_path / "s.h5")
    add_analysis(path, {"runs": [{"id": "r", "speed_mm_s": 1.0, "latency_ms": 2.0}]}, {})
    with h5py.File(path) as file:
        layout = layout_of(file)
    conforms("session-file", layout)
    layout["/runs/r" if not whole else "/runs/run-01"]["attributes"]["start_s"] = "early"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(layout, schemas()["session-file"])
