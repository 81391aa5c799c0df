"""Every import of another package has a line that installs it, and the line is that of pyproject.toml."""

import ast
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from draglag.errors import DraglagError
from draglag.system.packages import PACKAGES, Package, advice, missing_package, need

ROOT = Path(__file__).parents[2]
OURS = {"draglag", "draglag_devices", "draglag_app", "draglag_resources", "blind"}
# Packages that bring a second module.
WITH_ANOTHER = {"shiboken6": "PySide6", "pydantic_core": "pydantic", "markupsafe": "jinja2"}


def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def names(requirements: list[str]) -> set[str]:
    """Those that this machine and Python get."""
    wanted = map(Requirement, requirements)
    return {one.name for one in wanted if one.marker is None or one.marker.evaluate()}


def imported() -> set[str]:
    """Top-level modules that the program imports and that are neither its own nor Python's."""
    found = set()
    for folder in ("core", "devices", "app", "resources"):
        for file in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                if isinstance(node, ast.Import):
                    found |= {alias.name.partition(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module:
                    found.add(node.module.partition(".")[0])
    return found - set(sys.stdlib_module_names) - OURS


def test_the_table_names_the_packages_of_pyproject() -> None:
    assert {p.name for p in PACKAGES.values() if not p.extra} == names(project()["dependencies"])
    for package in PACKAGES.values():
        if package.extra:
            assert package.name in names(project()["optional-dependencies"][package.extra])


def test_every_import_is_in_the_table() -> None:
    assert {WITH_ANOTHER.get(name, name) for name in imported()} <= set(PACKAGES)


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("serial.tools", 'pip install "draglag[devices]"'),
        ("PySide6.QtWidgets", 'pip install "draglag[gui]"'),
        ("matplotlib.figure", 'pip install "draglag[report]"'),
        ("pandas", 'pip install "draglag[frames]"'),
        ("h5netcdf", 'pip install "draglag[netcdf]"'),
        ("distributed", 'pip install "draglag[cluster]"'),
    ],
)
def test_the_line_to_type_is_that_of_the_package(module: str, line: str) -> None:
    assert advice(module)[1] == f"run: {line}"
    assert line in str(missing_package(ModuleNotFoundError(name=module)))


def test_a_module_that_nobody_knows_is_no_package_to_install() -> None:
    assert missing_package(ModuleNotFoundError(name="draglag.nothing")) is None
    assert "pip" not in advice("draglag.nothing")[1]
    assert Package("a").line == "pip install a"


def test_what_is_needed_is_asked_for_before_long_work(monkeypatch: pytest.MonkeyPatch) -> None:
    need("numpy", "scipy.stats")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(DraglagError, match=r'matplotlib.*run: pip install "draglag\[report\]"'):
        need("numpy", "matplotlib")


def test_the_library_alone_needs_neither_a_window_nor_devices_nor_drawings() -> None:
    apart = {"PySide6-Essentials", "pyqtgraph", "evdev", "evdev-binary", "pysoem", "pyserial", "matplotlib"}
    assert not apart & names(project()["dependencies"])
    every = Requirement(project()["optional-dependencies"]["all"][0])
    assert every.extras == {p.extra for p in PACKAGES.values() if p.extra}
