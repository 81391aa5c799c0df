"""`draglag blind` as people meet it, without running the workflow."""

import pytest
from click.testing import CliRunner

from blind.conditions import Task
from blind.pool import Unavailable, run_all
from draglag_app.cli import blind as command
from draglag_app.cli import cli


def test_says_that_it_needs_a_checkout(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "__file__", str(tmp_path / "lib" / "draglag_app" / "cli" / "blind.py"))
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(cli, ["blind", "--quick"])
    assert result.exit_code == 1
    assert "needs a checkout" in result.stderr
    assert result.stdout == ""


def test_unknown_row_is_named():
    result = CliRunner().invoke(cli, ["blind", "--only", "no_such_effect"])
    assert result.exit_code == 1
    assert "no_such_effect" in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_cluster_without_scheduler_is_one_sentence():
    with pytest.raises(Unavailable) as caught:
        list(run_all([Task("none", "none", 1.0, 1)], jobs=1, scheduler="tcp://127.0.0.1:9"))
    assert caught.value.remedy
    assert "\n" not in str(caught.value)
