"""What another package brings, as an installed one does it: its module on the path, its entry points in metadata."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

EXAMPLES = Path(__file__).parents[1] / "examples"


def installed(folder: Path, entry_points: dict[str, str], group: str) -> Path:
    """A folder for the module path that holds an installed package's metadata with these entry points."""
    info = folder / "stranger-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
    lines = "".join(f"{name} = {value}\n" for name, value in entry_points.items())
    (info / "entry_points.txt").write_text(f"[{group}]\n{lines}")
    return folder


def example(name: str, group: str, folder: Path) -> list[Path]:
    """Folders for the module path that make an example package an installed one."""
    made = tomllib.loads((EXAMPLES / name / "pyproject.toml").read_text("utf-8"))
    return [EXAMPLES / name, installed(folder, made["project"]["entry-points"][group], group)]


def with_packages(paths: list[Path], *arguments: object) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own, with more folders on its module path."""
    return python(paths, "from draglag_app.cli.main import main; main()", *arguments)


def python(paths: list[Path], code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Python code in a process of its own, with more folders on its module path."""
    known = os.environ.get("PYTHONPATH", "")
    path = os.pathsep.join([*map(str, paths), *filter(None, [known])])
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
