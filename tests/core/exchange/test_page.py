"""The pages on files of others: their examples are read, and mean what the pages say."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from draglag.analysis import analyze
from draglag.exchange import read_exchange
from draglag.store import read_session
from draglag_app.cli.main import cli

PAGE = Path(__file__).parents[3] / "docs" / "exchange.md"


def test_the_shortest_header_of_the_page_is_read(tmp_path: Path) -> None:
    header = json.loads(PAGE.read_text("utf-8").split("```json")[1].split("```")[0])
    (tmp_path / "session.json").write_text(json.dumps(header))
    # A held position repeats at a later stamp and stays; the row that comes twice counts once.
    rows = ("0.10,5,5", "0.11,6,5", "0.12,6,5", "0.12,6,5", "0.13,7,5")
    (tmp_path / "run-01.touch.csv").write_text("\n".join(("t_s,x_mm,y_mm", *rows)))
    (tmp_path / "run-01.laser.csv").write_text("t_s,light\n0.05,1\n0.115,0\n0.125,1\n")
    (run,) = read_exchange(tmp_path).runs
    assert run.touch.t_s.tolist() == [0.10, 0.11, 0.12, 0.13]
    assert run.laser.light.tolist() == [1, 0, 1]
    assert run.radius_mm == 60
    assert run.start_s == pytest.approx(0.05)
    assert run.start_s + run.duration_s == pytest.approx(0.13)


def test_the_examples_of_the_page_on_importing_are_of_the_format_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = PAGE.with_name("importing.md").read_text("utf-8")
    examples = re.findall(r"```bash\n(.*?)```", page, re.S)
    assert len(examples) == 2
    for example in examples:
        *tables, command = example.replace("\\\n", " ").strip().split("\n")
        for table in tables:
            _, text, _, name = shlex.split(table)
            (tmp_path / name).write_text(text.replace("\\n", "\n"), "utf-8")
        _, *arguments = shlex.split(command)
        done = CliRunner().invoke(cli, arguments)
        assert done.exit_code == 0, done.output
        (run,) = read_session(tmp_path / arguments[-1]).runs
        assert len(run.touch.t_s) == 3
        (estimate,) = analyze(read_session(tmp_path / arguments[-1])).runs
        assert "no_touch" in estimate.flags
    assert "The two examples on this page show the format only" in page
