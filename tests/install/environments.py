"""Fresh environments with the wheel of this checkout, on the Pythons of this machine; uv makes them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
OLDEST_MINOR = 11  # of Python 3: requires-python of pyproject.toml
_UV = Path(sys.executable).with_name("uv")


def uv(*arguments: object) -> subprocess.CompletedProcess[str]:
    """uv with these arguments; the test is skipped where there is none."""
    if not _UV.exists():
        pytest.skip("uv is not installed (extra dev)")
    command = [str(_UV), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)


@cache
def without_network() -> str:
    """Why the package index does not answer; empty where it does."""
    asked = uv("pip", "install", "--dry-run", "--reinstall", "--python", sys.executable, "--no-cache", "tomli-w")
    return "" if asked.returncode == 0 else " ".join(asked.stderr.split())[-200:]


def need_network() -> None:
    if problem := without_network():
        pytest.skip(f"the package index is not reachable: {problem}")


@cache
def pythons() -> list[Path]:
    """The supported Pythons of this machine, on the path or pyenv's, one of each minor version, oldest first."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    found: dict[int, Path] = {}
    for minor in range(OLDEST_MINOR, OLDEST_MINOR + 10):
        places = [*sorted(pyenv.glob(f"3.{minor}.*/bin/python3")), shutil.which(f"python3.{minor}")]
        for place in filter(None, places):
            asked = subprocess.run([place, "-c", "import ensurepip"], capture_output=True, check=False)
            if asked.returncode == 0:
                found[minor] = Path(place)
    return [found[minor] for minor in sorted(found)]


class Environment:
    """A virtual environment that holds draglag and what its base dependencies bring."""

    def __init__(self, folder: Path, wheel: Path, python: Path | str, extras: str = "") -> None:
        need_network()
        self.python = folder / "bin" / "python"
        made = uv("venv", "--quiet", "--python", python, folder)
        assert made.returncode == 0, made.stderr
        done = uv("pip", "install", "--quiet", "--python", self.python, f"draglag{extras} @ {wheel.as_uri()}")
        assert done.returncode == 0, done.stderr

    def draglag(self, *arguments: object) -> subprocess.CompletedProcess[str]:
        """The command line of this environment; no path of the checkout leads into it."""
        command = [str(self.python.with_name("draglag")), *map(str, arguments)]
        env = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "DISPLAY")}
        return subprocess.run(command, capture_output=True, text=True, check=False, env=env, cwd=self.python.parent)

    def modules(self) -> set[str]:
        """Names of the installed packages, in lower case."""
        listed = uv("pip", "list", "--python", self.python, "--format", "json")
        return {one["name"].lower() for one in json.loads(listed.stdout)}
