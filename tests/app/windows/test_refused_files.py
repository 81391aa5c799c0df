"""Files whose values are refused: each sort of refusal in draglag's words, in English and in Dutch."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from pydantic import BaseModel, ValidationError
from PySide6.QtWidgets import QApplication

from draglag.errors import DataError
from draglag.exchange import read_exchange
from draglag.model.file import load_model
from draglag.protocol.presets import load_screen_file
from draglag.protocol.runs import load_protocol
from draglag.reading.refusals import refusal
from draglag_app.windows.wording.i18n import use_language
from draglag_app.windows.wording.library_words import in_words

PROTOCOL = 'name = "p"\n[[runs]]\nkind = "circle"\nspeed_mm_s = 100\n'
SCREEN = 'name = "s"\n[screen]\nwidth_mm = 300\nheight_mm = 200\nwidth_px = 1920\nheight_px = 1080\n'
HEADER = {
    "format": "draglag-exchange", "version": 1, "runs": [], "stylus_diameter_mm": 7,
    "screen": {"name": "s", "width_mm": 300, "height_mm": 200, "width_px": 1920, "height_px": 1080},
}  # fmt: skip
CURVE = {
    "form": "double_exponential", "covariance": [[0.0] * 5] * 5, "speed_range_mm_s": [0, 500], "n_points": 9,
    "rms_ms": 1.0, "parameters": {"a1_ms": 20, "a2_s_per_mm": 0.01, "a4_ms": 9, "a5_s_per_mm": 0.1, "a7_ms": 30},
}  # fmt: skip
RAW = {name: [0.0] * 3 for name in ("x_raw", "y_raw", "x_mm", "y_mm")} | {"matrix": [[0, 0, 0], [0, 0, 0]]}

IN_PROTOCOL = [
    ('name = "p"\n', "", "is missing", "ontbreekt"),
    ("speed_mm_s", "speed", "there is no such key", "deze sleutel bestaat niet"),
    ("= 100", "= true", "expected a number", "verwacht werd een getal"),
    ("= 100", '= "fast"', "expected a number", "verwacht werd een getal"),
    ("= 100", "= -1", "expected a number greater than 0", "verwacht werd een getal groter dan 0"),
    ("= 100", "= 1e9", "expected a number of at most 20000", "verwacht werd een getal van ten hoogste 20000"),
    ("= 100", "= inf", "expected a finite number", "verwacht werd een eindig getal"),
    ("= 100", "= 100\nrepeats = 0", "expected a number of at least 1", "verwacht werd een getal van ten minste 1"),
    ("= 100", "= 100\nrepeats = []", "expected a whole number", "verwacht werd een geheel getal"),
    ("= 100", '= 100\nrepeats = "x"', "expected a whole number", "verwacht werd een geheel getal"),
    ("= 100", "= 100\nrepeats = 1.5", "expected a whole number", "verwacht werd een geheel getal"),
    ("= 100", "= 100\nstep_fraction = 2", "expected a number less than 0.9", "verwacht werd een getal kleiner dan 0.9"),
    ("= 100", '= 100\npractice = "perhaps"', "expected true or false", "verwacht werd true of false"),
    ("= 100", "= 100\npractice = []", "expected true or false", "verwacht werd true of false"),
    ("= 100", "= 100\nturn = 2", "expected one of 1, -1", "verwacht werd een van 1, -1"),
    ("speed_mm_s = 100", "speeds_mm_s = 9", "expected a list […]", "verwacht werd een lijst […]"),
    (
        "speed_mm_s = 100", f"speeds_mm_s = {[9] * 20_000}",
        "expected at most 10000 values", "verwacht werden ten hoogste 10000 waarden",
    ),
]  # fmt: skip
IN_SCREEN = [
    ('"s"', '""', "expected a text of at least 1 characters", "verwacht werd een tekst van ten minste 1 tekens"),
    ('"s"', "5", "expected a text", "verwacht werd een tekst"),
    ('name = "s"', 'name = "s"\nlaw = 5', "expected a table of keys", "verwacht werd een tabel met sleutels"),
]
IN_HEADER = [
    ({"screen": None}, "expected an object {…}, not null", "verwacht werd een object {…}, niet null"),
    ({"runs": "x"}, 'expected a list […], not "x"', 'verwacht werd een lijst […], niet "x"'),
    ({"version": "2"}, 'expected 1, not "2"', 'verwacht werd 1, niet "2"'),
    ({"taps": "a" * 201}, "expected a text of at most 200 characters", "verwacht werd een tekst van ten hoogste 200"),
    ({"calibration": RAW | {"matrix": []}}, "expected at least 2 values", "verwacht werden ten minste 2 waarden"),
    ({"calibration": RAW | {"x_mm": []}}, "y_mm of one length", "y_mm van één lengte"),
]
IN_MODEL = [
    ({"form": "cubic"}, "unknown curve form 'cubic'", "onbekende vorm van de kromme 'cubic'"),
    ({"parameters": {}}, "has the parameters", "heeft de parameters"),
    ({"covariance": []}, "covariance must be 5 × 5", "covariance moet 5 × 5 zijn"),
    ({"speed_range_mm_s": [9, 1]}, "must run from low to high", "moet van laag naar hoog lopen"),
    ({"speed_range_mm_s": [9]}, "speed_range_mm_s.1: is missing", "speed_range_mm_s.1: ontbreekt"),
    ({"rms_ms": "much"}, "rms_ms: expected a number", "rms_ms: verwacht werd een getal"),
    ({"parameters": CURVE["parameters"] | {"a1_ms": 1e308}}, "latencies beyond 60 s", "vertragingen boven 60 s"),
    ({"effects": [{"id": "magic"}]}, "unknown effect 'magic'", "onbekend effect 'magic'"),
]


@pytest.fixture
def refused(qapp: QApplication):
    """Compares the refusal by ``load`` with its words in both languages."""

    def compare(load, path: Path, english: str, dutch: str) -> None:
        with pytest.raises(DataError) as caught:
            load(path)
        assert english in str(caught.value)
        use_language(qapp, "nl")
        assert dutch in in_words(caught.value.message)
        assert "nput" not in in_words(caught.value.message)

    yield compare
    use_language(qapp, "en")


@pytest.mark.parametrize(
    ("load", "sound", "old", "new", "english", "dutch"),
    [
        *((load_protocol, PROTOCOL, *one) for one in IN_PROTOCOL),
        *((load_screen_file, SCREEN, *one) for one in IN_SCREEN),
    ],
)
def test_a_protocol_or_screen(
    refused, tmp_path: Path, load, sound: str, old: str, new: str, english: str, dutch: str
) -> None:
    path = tmp_path / "file.toml"
    path.write_text(sound)
    load(path)
    path.write_text(sound.replace(old, new))
    refused(load, path, english, dutch)


@pytest.mark.parametrize(("change", "english", "dutch"), IN_HEADER)
def test_an_exchange_folder(refused, tmp_path: Path, change: dict, english: str, dutch: str) -> None:
    (tmp_path / "session.json").write_text(json.dumps(HEADER | change))
    refused(read_exchange, tmp_path, english, dutch)


@pytest.mark.parametrize(("change", "english", "dutch"), IN_MODEL)
def test_a_model(refused, tmp_path: Path, change: dict, english: str, dutch: str) -> None:
    path = tmp_path / "model.json"
    path.write_text(json.dumps(CURVE))
    load_model(path)
    path.write_text(json.dumps(CURVE | change))
    refused(load_model, path, english, dutch)


def test_a_refusal_that_is_not_known_keeps_its_own_words() -> None:
    class Odd(BaseModel):
        raw: bytes

    with pytest.raises(ValidationError) as caught:
        Odd.model_validate({"raw": 5})
    assert refusal(caught.value.errors()[0]) == "input should be a valid bytes"
