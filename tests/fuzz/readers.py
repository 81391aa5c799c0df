"""The readers under trial: what each is given, and what it may do with it: return, or raise a DraglagError."""

from __future__ import annotations

import gzip
import json
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from core.xdf_files import BOUNDARY, xdf_file
from draglag.curve import CurvePoints, fit_form
from draglag.errors import DataError, DraglagError
from draglag.exchange import read_exchange
from draglag.exchange.importers import HowToRead, parse_map, read_recordings
from draglag.exchange.importers.columns import read_laser_columns
from draglag.exchange.importers.walt import read_walt_laser
from draglag.exchange.streams import read_display, read_gaps, read_laser, read_taps, read_touch
from draglag.exchange.tables import read_events
from draglag.instruments.calibration import fit_affine, target_places
from draglag.model.file import load_model, lookup_table, model_of, save_model
from draglag.protocol.presets import load_screen_file
from draglag.protocol.runs import expand, load_protocol, load_screen
from draglag.recording import Screen, Session, TouchCalibration
from draglag.simulation import LatencyLaw
from draglag.store import codec, session_nodes
from draglag.store.sense import check_times
from draglag_app.windows.settings import Settings, load_settings, save_settings
from draglag_devices.addresses import parse_address
from draglag_devices.calibration import load_touches, save_calibration
from draglag_devices.replay import load_tape
from draglag_resources import presets, resource

TOUCH = b"t_s,x_mm,y_mm\n0.0,1.5,2.0\n0.008,1.6,2.1\n0.016,1.7,2.2\n"
LASER = b"t_s,light\n0.001,1\n0.01,0\n0.02,1\n"
EVEMU = (
    b"# EVEMU 1.3\nN: panel\nA: 2f 0 9 0 0 0\nA: 35 0 3999 0 0 40\nA: 36 0 1999 0 0 40\nE: 0.000 0003 0039 1\n"
    b"E: 0.0 0003 0035 400\nE: 0.000 0003 0036 800\nE: 0.000 0000 0000 0\nE: 0.010 0003 002f 1\nE: 0.010 0003 0039 2\n"
    b"E: 0.010 0003 0035 440\nE: 0.010 0003 0036 10\nE: 0.010 0004 0005 900\nE: 0.010 0000 0000 0\n"
    b"E: 0.015 0000 0003 0\nE: 0.015 0000 0000 0\nE: 0.020 0003 0039 -1\nE: 0.020 0000 0000 0\n"
)
PACKETS = (
    b"N: old panel\nA: 35 0 3999 0 0 40\nA: 36 0 1999 0 0 40\nE: 0.0 3 35 400\nE: 0.0 3 36 800\nE: 0.0 0 2 0\n"
    b"E: 0.0 3 35 900\nE: 0.0 3 36 100\nE: 0.0 0 2 0\nE: 0.0 0 0 0\nE: 0.1 3 35 410\nE: 0.1 3 36 800\nE: 0.1 0 2 0\n"
    b"E: 0.1 0 0 0\nE: 0.2 1 14a 0\nE: 0.2 0 0 0\n"
)
EVTEST = (
    b'Input device name: "panel"\n  Event type 3 (EV_ABS)\n    Event code 53 (ABS_MT_POSITION_X)\n      Min        0\n'
    b"      Max     3999\n      Resolution      40\n    Event code 54 (ABS_MT_POSITION_Y)\n      Min        0\n"
    b"      Max     1999\n      Resolution      40\n"
    b"Event: time 1.000000, type 3 (EV_ABS), code 57 (ABS_MT_TRACKING_ID), value 7\n"
    b"Event: time 1.000000, type 3 (EV_ABS), code 53 (ABS_MT_POSITION_X), value 400\n"
    b"Event: time 1.000000, type 3 (EV_ABS), code 54 (ABS_MT_POSITION_Y), value 800\n"
    b"Event: time 1.000000, -------------- SYN_REPORT ------------\n"
    b"Event: time 1.010000, type 4 (EV_MSC), code 4 (MSC_SCAN), value d00e3\n"
    b"Event: time 1.010000, >>>>>>>>>>>>>> SYN_DROPPED <<<<<<<<<<<<\n"
    b"Event: time 1.020000, -------------- SYN_REPORT ------------\n"
)
LIBINPUT = (
    b'# libinput record\nversion: 1\nndevices: 1\ndevices:\n- node: /dev/input/event4\n  evdev:\n    name: "panel"\n'
    b"    absinfo:\n      53: [0, 3999, 0, 0, 40]\n      54: [0, 1999, 0, 0, 40]\n  events:\n  - evdev:\n"
    b"    - [  1,      0,   3,  57,      7] # EV_ABS\n    - [  1,      0,   3,  53,    400]\n"
    b"    - [  1,      0,   3,  54,    800]\n    - [  1,      0,   0,   0,      0]\n"
)
SIZED = b"# EVEMU 1.2\n# Size in mm: 345x194\n" + EVEMU.partition(b"\n")[2]
XDF_HEAD = (
    b"<info><name>panel</name><type>Touch</type><channel_count>2</channel_count><nominal_srate>100</nominal_srate>"
    b"<channel_format>float32</channel_format><desc><channels><channel><label>x_mm</label></channel>"
    b"<channel><label>y_mm</label></channel></channels></desc></info>"
)
TABLE = b"# note\nstamp;a;b;id\n0;1,5;2;1\n8,5;1,6;2,5;1\n16;1,7;;2\n"
SCREEN = Screen("fuzz", 500.0, 280.0, 1920, 1080)


@dataclass(frozen=True)
class Reader:
    """A reader of one kind of file.

    Attributes:
        file: name of the file under trial, in a folder of its own.
        seeds: contents that it reads.
        read: reads that file, and uses it as the program does next.
        others: further files of the folder.
    """

    name: str
    file: str
    seeds: tuple[bytes, ...]
    read: Callable[[Path], object]
    others: tuple[tuple[str, bytes], ...] = ()

    def prepare(self, folder: Path) -> None:
        for name, data in self.others:
            (folder / name).write_bytes(data)

    def attempt(self, folder: Path, data: bytes) -> bool:
        """Whether the reader accepted the data. Raises whatever is neither acceptance nor refusal."""
        path = folder / self.file
        path.write_bytes(data)
        try:
            with np.errstate(all="ignore"):
                self.read(path)
        except DraglagError as error:
            if "\n" in str(error) or not str(error).strip():
                raise AssertionError(f"a refusal is one sentence, not {str(error)!r}") from error
            return False
        return True


def _header() -> bytes:
    run = {
        "id": "r1",
        "protocol": "circle",
        "nominal_speed_mm_s": 100.0,
        "radius_mm": 40.0,
        "duration_s": 0.1,
        "start_s": 0.0,
    }
    more = {
        "target": {"kind": "circle", "radius_mm": 40.0, "turn": 1},
        "outcome": "complete",
        "seed": 3,
        "as_recorded": True,
        "touch_dropped": 1,
        "touch_axes": [{"name": "ABS_X", "minimum": 0, "maximum": 4095, "resolution": 10, "fuzz": 0}],
        "laser_missed": 0,
        "sync": [{"stream": "laser", "file": "clock.csv"}],
        "log": [{"t_s": 0.0, "level": "info", "source": "touch", "text": "a"}],
    }
    header = {
        "format": "draglag-exchange",
        "version": 1,
        "name": "s",
        "stylus_diameter_mm": 7.0,
        "clock": "host",
        "taps": "taps.csv",
        "screen": {"name": "s", "width_mm": 300.0, "height_mm": 200.0, "width_px": 1024, "height_px": 768},
        "runs": [run | more],
        "beam": {"slope": 0.01, "intercept_mm": 100.0},
        "protocol_file": "protocol.toml",
        "clocks": [{"stream": "touch", "file": "clock.csv"}],
        "devices": {"touch": "panel"},
        "started_s": 0.0,
        "seed": 1,
        "calibration": {"x_raw": [1.0], "y_raw": [1.0], "x_mm": [1.0], "y_mm": [1.0], "matrix": [[1, 0, 0], [0, 1, 0]]},
        "notes": "a note",
        "taps_rejected": {"late": 2},
        "simulated": False,
    }
    return json.dumps(header, indent=1).encode()


def _calibration(folder: Path) -> bytes:
    x_mm, y_mm = target_places(SCREEN.width_mm, SCREEN.height_mm)
    fit = fit_affine(x_mm * 40, y_mm * 40, x_mm, y_mm)
    path = folder / "made.json"
    save_calibration(
        fit, path, "panel", TouchCalibration(x_mm * 40, y_mm * 40, x_mm, y_mm, fit.matrix, "panel", "2026")
    )
    return path.read_bytes()


def _settings(folder: Path) -> bytes:
    save_settings(Settings(folder="/tmp/draglag"), folder / "made.toml")
    return (folder / "made.toml").read_bytes()


def _model(folder: Path) -> bytes:
    speed = np.geomspace(44, 1000, 16)
    law = LatencyLaw(90.53, 4e-3, 182.9, 2.9e-2, 28.49)
    points = CurvePoints(speed, law.latency_s(speed), np.full(16, 1e-4))
    effects = [("clock_drift", {"ppm": 60.0}), ("low_speed_plateau", {"speed_mm_s": 100.0})]
    save_model(model_of(fit_form(points, "double_exponential"), effects=effects), folder / "made-model.json")
    return (folder / "made-model.json").read_bytes()


def _preset(kind: str) -> tuple[bytes, ...]:
    return tuple(resource(kind, f"{name}.toml").read_bytes() for name in presets(kind))


def _use_model(path: Path) -> None:
    lookup_table(load_model(path), 20)


def _use_protocol(path: Path) -> None:
    expand(load_protocol(path), SCREEN)


def _tape(scheme: str, role: str) -> Callable[[Path], object]:
    return lambda path: load_tape(parse_address(f"{scheme}:{path}"), role)


def _recording(kind: str | None, *mapped: str, screen: Screen | None = SCREEN) -> Callable[[Path], object]:
    how = HowToRead(kind, None, parse_map(mapped), screen)
    return lambda path: _use_session(read_recordings((path,), how))


def _use_session(session: Session) -> None:
    """As far as a file is written and read, without the disk: what is imported must be readable afterwards."""
    try:
        check_times(session, "session")
    except DataError as error:
        raise AssertionError("the session file would be refused") from error
    for node in session_nodes.session_nodes(session):
        codec.decode(codec.encode(codec.Record((node,), (), {}, 0)))


# Between the chunks of an XDF file as the trials have it, whose lengths are put in when it is read.
_NEXT_CHUNK = b"\n--\n"


def _xdf() -> bytes:
    """Two streams, as chunks without their lengths."""
    laser = XDF_HEAD.replace(b"panel", b"diode").replace(b"<channel_count>2", b"<channel_count>1")
    laser = laser.replace(b"x_mm", b"light").replace(b"float32", b"int8").replace(b"100<", b"0<")
    chunks = [struct.pack("<H", 1) + b"<?xml version='1.0'?><info><version>1.0</version></info>"]
    for stream, head in ((1, XDF_HEAD), (2, laser)):
        chunks.append(struct.pack("<HI", 2, stream) + b"<?xml version='1.0'?>" + head)
        chunks.append(struct.pack("<HIdd", 4, stream, 0.0, 0.001))  # one: pyxdf takes 0.1 s for a line through two
    one = [struct.pack("<Bdff", 8, 1.0, 10.0, 20.0), struct.pack("<Bff", 0, 11.0, 21.0), struct.pack("<Bff", 0, 12, 22)]
    chunks.append(struct.pack("<HIBB", 3, 1, 1, len(one)) + b"".join(one))
    chunks.append(struct.pack("<HIBB", 3, 2, 1, 2) + struct.pack("<BdbBdb", 8, 1.005, 0, 8, 1.015, 1))
    chunks.append(BOUNDARY)
    chunks.append(struct.pack("<HI", 6, 1) + b"<info><sample_count>3</sample_count></info>")
    return _NEXT_CHUNK.join(chunks)


def _with_lengths(data: bytes) -> bytes:
    return xdf_file(data.split(_NEXT_CHUNK))


def _xdf_of_chunks(path: Path) -> None:
    built = path.with_suffix(".xdf")
    built.write_bytes(_with_lengths(path.read_bytes()))
    _recording("xdf")(built)


def _columns_as_mapped(path: Path) -> None:
    """The map's texts, a line each, used on one table."""
    mapped = path.read_text("utf-8", errors="replace").split("\n")
    _recording("csv", *mapped)(path.with_name("table.csv"))


def readers(scratch: Path) -> tuple[Reader, ...]:
    """Every reader of text. ``scratch``: a folder in which contents are made."""
    taps = b"physical_s,registered_s,down\n1.0,1.03,1\n1.5,1.53,0\n"
    clock = b"device_s,host_min_s,host_max_s,epoch\n0.0,1.0,1.001,0\n1.0,2.0,2.001,0\n"
    folder = (
        ("r1.touch.csv", TOUCH),
        ("r1.laser.csv", LASER),
        ("taps.csv", taps),
        ("clock.csv", clock),
        ("protocol.toml", b""),
    )
    return (
        Reader("exchange header", "session.json", (_header(),), lambda path: read_exchange(path.parent), folder),
        Reader("exchange touch", "r1.touch.csv", (TOUCH,), read_touch),
        Reader("exchange laser", "r1.laser.csv", (LASER,), read_laser),
        Reader("exchange taps", "taps.csv", (taps,), read_taps),
        Reader("exchange display", "r1.display.csv", (TOUCH,), lambda path: read_display(path, 0)),
        Reader("exchange gaps", "r1.gaps.csv", (b"start_s,end_s\n1,2\n3,4\n",), read_gaps),
        Reader(
            "exchange clocks",
            "clock.csv",
            (clock,),
            lambda path: read_exchange(path.parent),
            (*folder, ("session.json", _header())),
        ),
        Reader("gzipped table", "r1.touch.csv.gz", (gzip.compress(TOUCH, mtime=0),), read_touch),
        Reader(
            "events to compensate",
            "in.csv",
            (TOUCH + b"# note\n1,,3\n",),
            lambda path: read_events(path, ("t_s", "x_mm", "y_mm")),
        ),
        Reader("csv: touch", "t.csv", (TOUCH,), _tape("csv", "touch")),
        Reader("csv: laser", "l.csv", (LASER,), _tape("csv", "laser")),
        Reader("replay: evemu", "r.events", (EVEMU, PACKETS), _tape("replay", "touch")),
        Reader("replay: evemu gzipped", "r.events.gz", (gzip.compress(EVEMU, mtime=0),), _tape("replay", "touch")),
        Reader("import: evemu", "r.events", (EVEMU, SIZED), _recording(None, screen=None)),
        Reader("import: evtest", "r.log", (EVTEST,), _recording(None, screen=None)),
        Reader("import: libinput", "r.yml", (LIBINPUT,), _recording(None, screen=None)),
        Reader("import: XDF", "r.xdf", (_with_lengths(_xdf()),), _recording(None)),
        Reader("import: XDF by chunks", "r.chunks", (_xdf(),), _xdf_of_chunks),
        Reader(
            "import: --map",
            "map.txt",
            (b"t=stamp:ms\nx=a:px\ny=b:in\ncontact=id\ndevice_t=stamp:us\nclock=-0.5\nstream=a\nlaser.light=b:>1.5",),
            _columns_as_mapped,
            (("table.csv", TABLE),),
        ),
        Reader("import: table", "r.csv", (TABLE,), _recording("csv", "t=stamp:ms", "x=a:px", "y=b", "contact=id")),
        Reader(
            "import: sampled laser",
            "r.laser.csv",
            (b"us\tvolt\n0\t0.1\n10000\t3.2\n15000\t0.2\n",),
            lambda path: read_laser_columns(path, parse_map(["laser.t=us:us", "laser.light=volt:>1.5"])),
        ),
        Reader("import: WALT's laser log", "r_laser.log", (b"1700000000.001 0\n1700000000.250 1\n",), read_walt_laser),
        Reader("calibration", "c.json", (_calibration(scratch),), load_touches),
        Reader("model", "m.json", (_model(scratch),), _use_model),
        Reader("protocol", "p.toml", _preset("protocols"), _use_protocol),
        Reader("screen", "s.toml", _preset("screens"), lambda path: (load_screen_file(path), load_screen(path))),
        Reader("settings", "settings.toml", (_settings(scratch),), load_settings),
    )
