"""The README's two commands work on a minimal Debian, as root and as a user without sudo."""

from __future__ import annotations

import os
import subprocess
import sys
from configparser import RawConfigParser
from pathlib import Path

import pytest

from fresh.pip_settings import as_file, local_places, read_settings

SCRIPT = Path(__file__).with_name("fresh.sh")
CASES = ("bookworm:root", "bookworm:user", "trixie:root", "trixie:user")


@pytest.mark.skipif(
    os.environ.get("DRAGLAG_TEST_FRESH") != "1",
    reason="root systems of Debian are made on request: ./run fresh, or DRAGLAG_TEST_FRESH=1",
)
@pytest.mark.parametrize("case", CASES)
def test_the_two_commands_work_on_a_minimal_debian(case: str) -> None:
    done = subprocess.run([SCRIPT, case], stderr=subprocess.STDOUT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode == 77:
        pytest.skip(done.stdout.strip())
    assert done.returncode == 0, done.stdout
    assert f"{case} passed" in done.stdout


def test_a_case_that_is_none_is_refused() -> None:
    done = subprocess.run([SCRIPT, "bookworm:everyone"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "bookworm:everyone: no such case. Cases: bookworm:root bookworm:user trixie:root trixie:user"
    ]


def test_a_root_system_gets_pip_s_settings_and_the_places_they_name(tmp_path: Path) -> None:
    index, wheels, limits = tmp_path / "index" / "simple", tmp_path / "wheels", tmp_path / "limits.txt"
    index.mkdir(parents=True)
    wheels.mkdir()
    limits.touch()
    listed = (
        f":env:.find-links='{wheels}'\nglobal.find-links='/elsewhere'\nglobal.timeout='60'\n"
        f"global.extra-index-url='file://{index}\\nhttps://packages.example/simple'\ninstall.constraint='{limits}'\n"
    )
    settings = read_settings(listed)
    out = tmp_path / "pip.conf"
    with out.open("w") as file:
        as_file(settings).write(file)
    written = RawConfigParser()
    written.read(out)
    assert dict(written["global"]) == {
        "find-links": str(wheels),  # the environment wins
        "timeout": "60",
        "extra-index-url": f"file://{index} https://packages.example/simple",
    }
    assert dict(written["install"]) == {"constraint": str(limits)}
    # An index leads to files next to its pages.
    assert set(local_places(settings)) == {index.parent, wheels, limits}


def test_pip_itself_lists_its_settings_in_the_form_that_is_read() -> None:
    env = {**os.environ, "PIP_TIMEOUT": "61"}
    command = [sys.executable, "-m", "pip", "config", "list"]
    listed = subprocess.run(command, env=env, check=True, capture_output=True, text=True).stdout
    assert read_settings(listed)["global", "timeout"] == "61"
