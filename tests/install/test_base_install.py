"""The published sdist and wheel work without a checkout; the wheel is library and command line alone.

On the oldest and newest Python found, one analysis on each between.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from install.environments import ROOT, Environment, need_network, pythons, uv

SAMPLES = ROOT / "tests" / "data" / "exchange"
ROOMS = ("app", "core", "devices", "resources")
FOR_EXTRAS = {"pyside6-essentials", "pyqtgraph", "evdev", "evdev-binary", "pysoem", "pyserial", "matplotlib", "pandas"}


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist, and the wheel that was built from the sdist."""
    need_network()  # for hatchling
    folder = tmp_path_factory.mktemp("published")
    built = uv("build", "--quiet", "--out-dir", folder)
    assert built.returncode == 0, built.stderr
    return folder


@pytest.fixture(scope="module")
def wheel(published: Path) -> Path:
    return next(published.glob("*.whl"))


def made(wheel: Path, folder: Path, python: Path) -> Environment:
    return Environment(folder / "venv", wheel, python)


@pytest.fixture(scope="module")
def base(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Environment:
    """A base install on the oldest Python found."""
    return made(wheel, tmp_path_factory.mktemp("oldest"), next(iter(pythons()), Path(sys.executable)))


@pytest.fixture(scope="module")
def newest(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Environment:
    if len(pythons()) < 2:
        pytest.skip("this machine has only one supported Python")
    return made(wheel, tmp_path_factory.mktemp("newest"), pythons()[-1])


def test_the_wheel_holds_all_of_the_four_packages_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as file:
        held = {name for name in file.namelist() if ".dist-info/" not in name}
    listed = subprocess.run(
        ["git", "ls-files", "-z", *ROOMS], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.split("\0")
    if len(listed) < 2:
        pytest.skip("this is no checkout of git")
    assert held == {name.partition("/")[2] for name in listed if (ROOT / name).is_file()}


def test_the_sdist_holds_what_a_package_is_built_and_tested_from(published: Path) -> None:
    with tarfile.open(next(published.glob("*.tar.gz"))) as file:
        held = {name.partition("/")[2] for name in file.getnames()}
    assert {"pyproject.toml", "LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "run", "mkdocs.yml"} <= held
    assert {"tests/core/curve/test_curve.py", "packaging/ethercat/draglag-ethercat-master.c", "docs/method.md"} <= held
    assert not any(name.startswith((".venv/", ".git/")) or name.endswith((".h5", ".pyc")) for name in held)


@pytest.mark.parametrize("python", pythons()[1:-1], ids=str)
def test_pythons_between_oldest_and_newest_analyse_a_session(wheel: Path, python: Path, tmp_path: Path) -> None:
    between = made(wheel, tmp_path, python)
    done = between.draglag("analyze", SAMPLES / "none-A", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["curve"]["form"]


@pytest.mark.parametrize("which", ["base", "newest"])
def test_a_base_install_analyses_a_folder_of_sessions(
    which: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    base = request.getfixturevalue(which)
    assert not FOR_EXTRAS & base.modules()
    for name, source in (("a", "none-A"), ("b", "low_speed_plateau")):
        done = base.draglag("import", SAMPLES / source, "--out", tmp_path / f"{name}.h5")
        assert done.returncode == 0, done.stderr
    shutil.copy(tmp_path / "a.h5", tmp_path / "c.h5")
    done = base.draglag("analyze", tmp_path, "--jobs", "2", "--out", tmp_path / "table.csv", "--json")
    assert done.returncode == 0, done.stderr
    results = [one["result"] for one in json.loads(done.stdout)["sessions"]]
    assert len(results) == 3
    assert all(result["curve"]["form"] for result in results)
    assert len((tmp_path / "table.csv").read_text().splitlines()) == 4


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("demo", "--no-window", "--out", "{}/demo"), 'pip install "draglag[report]"'),
        (("analyze", SAMPLES / "none-A", "--report", "{}/report"), 'pip install "draglag[report]"'),
        (("export", SAMPLES / "none-A", "--to", "netcdf", "--out", "{}/s.nc"), 'pip install "draglag[netcdf]"'),
        ((), 'pip install "draglag[gui]"'),
    ],
    ids=["demo", "report", "netcdf", "window"],
)
def test_what_an_extra_brings_is_one_sentence_with_the_line_to_type(
    base: Environment, tmp_path: Path, arguments: tuple[object, ...], line: str
) -> None:
    done = base.draglag(*(str(word).format(tmp_path) for word in arguments))
    assert done.returncode == 1
    (sentence,) = done.stderr.splitlines()
    assert sentence.startswith("draglag: the Python package ")
    assert sentence.endswith(f"run: {line}.")
    assert not list(tmp_path.iterdir())


SCRIPT = """
import draglag as dl

analysis = dl.analyze(dl.read("session.h5"))
reveal_type(analysis.runs[0].latency_s)

analysis.session + 1
"""


def test_the_types_of_an_installed_draglag_are_seen(base: Environment, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    mypy = [sys.executable, "-m", "mypy", "--strict", "--python-executable", str(base.python), "--config-file="]
    checked = subprocess.run(
        [*mypy, "--cache-dir", str(tmp_path), "script.py"], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert 'Revealed type is "float | None"' in checked.stdout.replace("builtins.", ""), checked.stdout
    (error,) = [line for line in checked.stdout.splitlines() if ": error: " in line]
    assert "script.py:7" in error
    assert "operator" in error


@pytest.mark.parametrize("platform", ["windows", "macos", "aarch64-manylinux_2_39"])
def test_every_platform_finds_its_packages(platform: str) -> None:
    need_network()
    compile_ = ("pip", "compile", "--quiet", "--python-platform", platform, "--python-version", "3.11")
    base = uv(*compile_, "--only-binary", ":all:", "pyproject.toml")
    assert base.returncode == 0, base.stderr
    assert "numpy==" in base.stdout
    whole = uv(*compile_, "--extra", "all", "pyproject.toml")
    assert whole.returncode == 0, whole.stderr
    assert "pyside6-essentials==" in whole.stdout
    assert ("evdev" in whole.stdout) == ("linux" in platform)
