"""What stands on the pages of the documentation runs as it stands."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import matplotlib as mpl
import pytest

from docs.snippets import PROGRAMS, ROOT, Snippet, pages, run_page, snippets

OTHERS = [block for page in pages() for block in snippets(page) if block.language in PROGRAMS]
RUN = [page for page in pages() if any(block.language in ("python", "bash") for block in snippets(page))]


@pytest.mark.parametrize("page", RUN, ids=lambda page: str(page.relative_to(ROOT)))
def test_python_and_commands_of_a_page_run(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", "")  # what a page draws goes to files
    mpl.use("agg")
    missing = run_page(snippets(page), folder)
    if missing:
        pytest.skip(f"of this page, blocks were not run: {', '.join(missing)} is not installed")


@pytest.mark.parametrize("block", OTHERS, ids=lambda block: f"{block.page.name}-{block.language}")
def test_another_program_reads_a_session_as_its_page_says(block: Snippet, folder: Path) -> None:
    command, end = PROGRAMS[block.language]
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} is not installed")
    if block.language == "r" and "library(rhdf5)" in block.code and _without_rhdf5():
        pytest.skip("the R package rhdf5 is not installed")
    script = folder / f"page{end}"
    script.write_text(block.code, "utf-8")
    done = subprocess.run(
        [*command, script.name], cwd=folder, env={**os.environ, "DISPLAY": ""}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "error" not in done.stderr.lower(), done.stderr


def _without_rhdf5() -> bool:
    asked = subprocess.run(["Rscript", "-e", "library(rhdf5)"], capture_output=True)
    return asked.returncode != 0
