"""The dependencies install without a compiler where wheels exist."""

import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

PROJECT = Path(__file__).parents[2] / "pyproject.toml"
SOURCE_ONLY = {"evdev"}  # on PyPI without any wheel


@pytest.mark.parametrize("python", ["3.11", "3.12", "3.13"])
def test_nothing_needed_to_measure_is_source_only(python: str) -> None:
    machine = {"sys_platform": "linux", "platform_machine": "x86_64", "python_version": python}
    project = tomllib.loads(PROJECT.read_text())["project"]
    wanted = map(Requirement, project["dependencies"] + project["optional-dependencies"]["devices"])
    names = {one.name for one in wanted if one.marker is None or one.marker.evaluate(machine)}
    assert "evdev-binary" in names
    assert not names & SOURCE_ONLY
