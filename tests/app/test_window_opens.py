"""The operator window from the command line: on what it opens, and what is said where it cannot."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from draglag.protocol.runs import load_protocol
from draglag_app.cli import cli, window
from draglag_app.cli.main import OPERATOR_WINDOW

SAMPLES = Path(__file__).parent.parent / "data" / "exchange"
NO_DISPLAY = "there is no display to draw on."


PROGRAM = "from draglag_app.cli import main; main()"
SHORT_DEMO = f"from app.test_window_opens import shorten_demo; shorten_demo(); {PROGRAM}"


def shorten_demo(patch: pytest.MonkeyPatch | None = None) -> None:
    """Have the demo command measure two circles alone; without ``patch`` for the rest of the process."""
    whole = load_protocol("demo")
    circles = whole.runs[1].model_copy(update={"speeds_mm_s": (240.0, 425.0), "duration_s": 15.0})
    short = whole.model_copy(update={"runs": (circles,), "taps": None, "clock_check": None})
    (patch or pytest.MonkeyPatch()).setattr("draglag_app.cli.demo.load_protocol", {"demo": short}.__getitem__)


def without_display(*arguments: object, program: str = PROGRAM, **variables: str) -> subprocess.CompletedProcess[str]:
    """The program as started from a console that has no desktop."""
    taken = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
    env = {key: value for key, value in os.environ.items() if key not in taken} | variables
    env["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    command = [sys.executable, "-c", program, *map(str, arguments)]
    return subprocess.run(command, env=env, capture_output=True, text=True, check=False)


@pytest.fixture
def session_file(tmp_path: Path) -> Path:
    path = tmp_path / "session.h5"
    assert CliRunner().invoke(cli, ["import", str(SAMPLES / "none-A"), "--out", str(path)]).exit_code == 0
    return path


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[Path | None]:
    """What the operator window was asked to open on; it is closed at once."""
    asked: list[Path | None] = []
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-7")
    monkeypatch.delenv("QT_QPA_PLATFORM", raising=False)
    monkeypatch.setattr(window, "need_display", lambda: None)
    monkeypatch.setattr(window, "load", {OPERATOR_WINDOW: lambda session: asked.append(session)}.__getitem__)
    return asked


@pytest.fixture
def short_demo(monkeypatch: pytest.MonkeyPatch) -> None:
    shorten_demo(monkeypatch)


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments])


def test_without_a_display_the_window_says_so_in_one_sentence(session_file: Path) -> None:
    on_screen = ("record", "demo", "--touch", "sim:", "--laser", "sim:", "--display", "screen 1", "--out")
    for arguments in ((), (session_file,), (*on_screen, session_file.with_name("new.h5"))):
        done = without_display(*arguments)
        assert done.returncode == 1
        assert done.stdout == ""
        (line,) = done.stderr.splitlines()
        assert line.startswith(f"draglag: {NO_DISPLAY} ")
        assert "desktop" in line


def test_without_a_display_the_demo_measures_and_says_where_the_report_is(tmp_path: Path) -> None:
    done = without_display("demo", "--out", tmp_path / "demo", program=SHORT_DEMO)
    assert done.returncode == 0, done.stderr
    report = tmp_path / "demo" / "report.html"
    assert report.is_file()
    assert done.stderr.splitlines()[-1] == f"The operator window is left out: {NO_DISPLAY} The report is {report}."


def test_a_session_file_in_the_place_of_a_command_opens_in_the_window(
    session_file: Path, opened: list[Path | None]
) -> None:
    assert run(session_file).exit_code == 0
    assert opened == [session_file]


def test_no_arguments_open_the_window_on_nothing(opened: list[Path | None]) -> None:
    assert run().exit_code == 0
    assert opened == [None]


def test_a_session_file_that_is_not_there_opens_nothing(tmp_path: Path, opened: list[Path | None]) -> None:
    result = run(tmp_path / "gone.h5")
    assert (result.exit_code, opened) == (1, [])
    assert result.stderr.splitlines() == [f"draglag: {tmp_path / 'gone.h5'}: there is no such file. Check the name."]


@pytest.mark.usefixtures("short_demo")
def test_the_demo_opens_the_window_on_what_it_measured(tmp_path: Path, opened: list[Path | None]) -> None:
    assert run("demo", "--out", tmp_path / "one").exit_code == 0
    assert opened == [tmp_path / "one" / "session.h5"]


@pytest.mark.usefixtures("short_demo")
def test_the_demo_does_not_wait_for_a_window_that_nobody_sees(
    tmp_path: Path, opened: list[Path | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    result = run("demo", "--out", tmp_path / "one")
    assert (result.exit_code, opened) == (0, [])
    assert f"The report is {tmp_path / 'one' / 'report.html'}." in result.stderr


def test_a_display_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("DISPLAY", ":40404")
    result = run()
    assert result.exit_code == 1
    assert result.stderr.startswith("draglag: the display :40404 does not answer. Start it from a desktop")


@pytest.mark.parametrize(("variables", "named"), [
    ({"WAYLAND_DISPLAY": "wayland-404"}, "WAYLAND_DISPLAY=wayland-404"),
    ({"WAYLAND_DISPLAY": "wayland-404", "DISPLAY": ":40404"}, "WAYLAND_DISPLAY=wayland-404"),
    ({"QT_QPA_PLATFORM": "wayland"}, "QT_QPA_PLATFORM=wayland"),
    ({"QT_QPA_PLATFORM": "no-such"}, "QT_QPA_PLATFORM=no-such"),
    ({"QT_QPA_PLATFORM": "wayland;xcb"}, "QT_QPA_PLATFORM=wayland;xcb"),
    ({"QT_QPA_PLATFORM": "xcb"}, "the display of X does not answer"),
], ids=str)  # fmt: skip
def test_a_display_on_which_qt_would_end_the_program_is_one_sentence(variables: dict[str, str], named: str) -> None:
    done = without_display(**variables)
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith("draglag: ")
    assert named in line


@pytest.mark.parametrize("library", ["libEGL.so.1", "libxcb-cursor.so.0"])
def test_a_library_that_qt_needs_and_lacks_is_named(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first is missed when Qt is imported, the second when it loads its plugin for X."""
    missing = f"{library}: cannot open shared object file: No such file or directory"

    def lacking(name: str) -> None:
        if name == OPERATOR_WINDOW and library == "libEGL.so.1":
            raise ImportError(missing)
        if name.endswith("libqxcb.so"):
            raise OSError(missing)

    monkeypatch.setenv("DISPLAY", ":7")
    monkeypatch.setenv("QT_QPA_PLATFORM", "xcb")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr(window, "_x_answers", lambda: True)
    monkeypatch.setattr(window, "load", lacking)
    monkeypatch.setattr(window.ctypes, "CDLL", lacking)
    result = run()
    assert result.exit_code == 1
    assert f"needs {library}, which is not installed" in result.stderr
