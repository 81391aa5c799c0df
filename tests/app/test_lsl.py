"""While recording, the Lab Streaming Layer carries what the file gets, and costs the recording nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from draglag.store import read_session
from draglag_app.cli.main import cli

PROTOCOL = """
name = "short"
description = "One circle."
seed = 1
rest_s = 1.0

[[runs]]
kind = "circle"
speeds_mm_s = [200]
radius_fraction = 0.1
duration_s = 8.0
"""


class FakeOutlet:
    """Keeps what is pushed; ``fails`` makes every push fail."""

    made: dict[str, FakeOutlet]
    fails = False

    def __init__(self, info: Any) -> None:
        self.samples: list[tuple[list[Any], float]] = []
        self.made[info.name] = self

    def push_sample(self, values: list[Any], t_s: float) -> None:
        if self.fails:
            raise RuntimeError("no room")
        self.samples.append((values, t_s))


def fake_pylsl() -> Any:
    class Element:
        def append_child(self, name: str) -> Element:
            return self

        def append_child_value(self, name: str, value: str) -> None:
            pass

    def info(name: str, *about: object) -> Any:
        return SimpleNamespace(name=name, desc=Element)

    return SimpleNamespace(StreamInfo=info, StreamOutlet=FakeOutlet, cf_double64=2, cf_string=3)


def record(folder: Path) -> Any:
    (folder / "p.toml").write_text(PROTOCOL, "utf-8")
    arguments = ["record", folder / "p.toml", "--touch", "sim:", "--laser", "sim:", "--lsl", "--out", folder / "s.h5"]
    return CliRunner().invoke(cli, list(map(str, arguments)))


def test_the_streams_hold_every_sample_of_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", fake_pylsl())
    monkeypatch.setattr(FakeOutlet, "made", {}, raising=False)
    assert record(tmp_path).exit_code == 0
    (run,) = read_session(tmp_path / "s.h5").runs
    pushed = {(t_s, *values[:2]) for values, t_s in FakeOutlet.made["draglag touch"].samples}
    assert len(run.touch.t_s) > 500
    assert set(zip(run.touch.t_s.tolist(), run.touch.x_mm.tolist(), run.touch.y_mm.tolist(), strict=True)) <= pushed
    edges = {t_s: values[0] for values, t_s in FakeOutlet.made["draglag laser"].samples}
    assert [edges[t] for t in run.laser.t_s.tolist()] == run.laser.light.tolist()
    markers = FakeOutlet.made["draglag markers"].samples
    assert [text for (text,), _ in markers] == [f"begin {run.id} circle", f"end {run.id} complete"]


def test_streams_that_cannot_be_fed_cost_a_warning_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", fake_pylsl())
    monkeypatch.setattr(FakeOutlet, "made", {}, raising=False)
    monkeypatch.setattr(FakeOutlet, "fails", True)
    done = record(tmp_path)
    assert done.exit_code == 0
    assert done.stderr.count("gets nothing any more (no room)") == 1
    assert read_session(tmp_path / "s.h5").runs[0].outcome == "complete"


def test_without_pylsl_the_line_to_type_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    done = record(tmp_path)
    assert done.exit_code == 1
    assert 'pip install "draglag[lsl]"' in done.stderr
    assert not (tmp_path / "s.h5").exists()


_RECEIVE = """
import numpy as np, pylsl
from draglag.recording import LaserTrace, TouchTrace
from draglag_app.lsl import lsl_listener
from draglag_app.session.digest import digest
from draglag_devices.source import Batch
listen = lsl_listener("test", lambda event: None)
found = {one.name(): one for one in pylsl.resolve_streams(2.0)}
inlets = {name: pylsl.StreamInlet(found[f"draglag {name}"]) for name in ("touch", "laser")}
for inlet in inlets.values():
    inlet.open_stream(10.0)
t_s = np.array([5.0, 5.01])
touch = TouchTrace(t_s, np.array([1.25, 2.5]), np.array([3.0, 4.0]), np.array([7, 7]))
listen(digest("touch", "", Batch(6.0, touch=touch), 0))
listen(digest("laser", "", Batch(6.0, laser=LaserTrace(t_s, np.array([1, 0]))), 0))
for name, inlet in inlets.items():
    channels = inlet.info(10.0).get_channel_labels()
    print(name, channels, [inlet.pull_sample(10.0) for _ in t_s])
"""


def test_a_receiver_gets_values_stamps_and_labels(tmp_path: Path) -> None:
    pytest.importorskip(
        "pylsl", reason="pylsl or liblsl is not installed", exc_type=(ImportError, RuntimeError, OSError)
    )
    # Loopback alone: nothing is announced to a network.
    (tmp_path / "lsl.cfg").write_text(
        "[lab]\nKnownPeers = {127.0.0.1}\n[multicast]\nResolveScope = machine\nListenAddress = 127.0.0.1\n"
        "[ports]\nIPv6 = disable\n",
        "utf-8",
    )
    command = ["unshare", "--net", "--map-root-user", "sh", "-c", 'ip link set lo up && exec "$@"', "sh"]
    script = [sys.executable, "-c", _RECEIVE]
    environment = {"LSLAPICFG": str(tmp_path / "lsl.cfg"), "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"}
    if subprocess.run([*command, "true"], env=environment, capture_output=True, check=False).returncode:
        pytest.skip("no network namespace of its own can be made here")
    done = subprocess.run([*command, *script], env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "touch ['x_mm', 'y_mm', 'contact_id'] [([1.25, 3.0, 7.0], 5.0), ([2.5, 4.0, 7.0], 5.01)]" in done.stdout
    assert "laser ['light'] [([1.0], 5.0), ([0.0], 5.01)]" in done.stdout
