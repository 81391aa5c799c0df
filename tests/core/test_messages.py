"""Messages are their rendered English, and keep the template and the arguments that they were made of."""

from __future__ import annotations

import copy
import json
import pickle

import numpy as np
import pytest

from draglag.errors import DataError, DraglagError, EstimateError, message_of
from draglag.messages import Message, chained, joined, message, packed, phrase, unpacked, without_stop
from draglag_devices.source import DeviceError


def test_a_message_is_its_sentence_and_keeps_what_it_was_made_of() -> None:
    said = message("{run}: latency {latency:.1f} ms of {n}", run="run-01", latency=np.float64(12.345), n=np.int64(3))
    assert said == "run-01: latency 12.3 ms of 3"
    assert said.template == "{run}: latency {latency:.1f} ms of {n}"
    assert said.arguments == {"run": "run-01", "latency": 12.345, "n": 3}


@pytest.mark.parametrize("name", ["{run}", "{", "}}{{", "{0}", "{run!r:>{width}}", "a file {path}: is not a file"])
def test_braces_in_values_are_text(name: str) -> None:
    assert message("{path}: there is no {run}", path=name, run="{path}") == f"{name}: there is no {{path}}"
    assert phrase(name) == name
    assert message("{one} and {other}", one=phrase(name), other=name) == f"{name} and {name}"
    assert str(DataError(message("{path}: is a folder", path=name))) == f"{name}: is a folder."
    assert str(DataError(name, "Choose another")) == f"{name}. Choose another."


def test_joined_messages_keep_their_parts() -> None:
    parts = (message("{n} edges", n=3), message("{n} touches", n=4), "{x}")
    said = joined(", ", parts)
    assert said == "3 edges, 4 touches, {x}"
    assert list(said.arguments.values()) == list(parts)
    assert joined(", ", ()) == ""


def test_words_between_parts_stand_in_a_template_of_their_own() -> None:
    said = chained("{before} or {next}", ("{x}", message("{n} edges", n=3), "c"))
    assert said == "{x} or 3 edges or c"
    assert isinstance(said, Message)
    assert said.template == "{before} or {next}"
    assert chained("{before} or {next}", ("{x}",)) == "{x}"


def test_an_error_keeps_the_messages_it_was_made_of() -> None:
    error = DataError(message("{path}: cannot be written ({why})", path="a.h5", why=phrase("full.")), "make room")
    assert str(error) == "a.h5: cannot be written (full.); make room."
    assert error.message == str(error)
    assert (error.problem, error.remedy) == ("a.h5: cannot be written (full.).", "make room.")
    inner = error.message.arguments["problem"]
    assert isinstance(inner, Message)
    assert inner.template == "{path}: cannot be written ({why})"
    again = EstimateError(message("{run}: {problem}", run="run-01", problem=error.problem), error.remedy)
    assert str(again) == "run-01: a.h5: cannot be written (full.); make room."


def test_control_characters_and_stops_are_taken_out_of_arguments() -> None:
    error = DataError(message("{path}: {why}", path="a\n\x1b[31mb", why="no room. "))
    assert error.problem == "a [31mb: no room."
    assert str(DataError(message("it failed ({why})", why=phrase("\x1b[31m{red}")))) == "it failed ( [31m{red})."
    assert without_stop(message("{why}.", why=phrase("x."))).template == "{why}"
    assert without_stop(message("{a}{b}", a="x. ", b="")) == "x"


@pytest.mark.parametrize(
    "error",
    [
        DraglagError("no", "Do it"),
        DataError(message("{path}: is a folder", path="{x}"), message("Name one of {names}", names="a")),
        DeviceError("evdev:/dev/input/event7", message("it was unplugged ({why})", why=phrase("gone")), "plug it in"),
    ],
)
def test_errors_cross_processes_whole(error: DraglagError) -> None:
    for again in (pickle.loads(pickle.dumps(error)), copy.deepcopy(error)):
        assert type(again) is type(error)
        assert (str(again), vars(again)) == (str(error), vars(error))
        assert again.message.template == error.message.template
        assert again.message.arguments == error.message.arguments


def test_messages_cross_a_wire_of_json() -> None:
    said = message("The laser is lost: {why}", why=message("the cable on {name} is unplugged", name="{why}"))
    line = json.dumps(packed({"text": said, "n": 1, "more": [said]}))
    back = json.loads(line, object_hook=unpacked)
    assert back == {"text": said, "n": 1, "more": [said]}
    assert back["text"].arguments["why"].template == "the cable on {name} is unplugged"
    # As JSON without ado it is its sentence.
    assert json.loads(json.dumps({"text": said})) == {"text": str(said)}


def test_what_any_exception_says_is_a_message() -> None:
    assert message_of(OSError("{path}")) == "{path}"
    assert message_of(DataError("no")).template == "{sentence}."
