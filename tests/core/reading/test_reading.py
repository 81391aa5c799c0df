"""What is read from files of others stays within its limits, and what is beyond is refused in one sentence."""

from __future__ import annotations

import gzip
import os
import tracemalloc
from pathlib import Path

import pytest

from draglag.errors import DataError, DraglagError
from draglag.reading import parse_json, parse_toml, plain_lines, read_bytes, read_text
from draglag.reading.limits import DEPTH, GZIP_FREE_BYTES, GZIP_RATIO, KEY_PARTS, LINE_BYTES, WHOLE_MOST


def test_a_file_of_the_largest_size_is_read_and_no_byte_more(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"x" * 1000)
    assert read_bytes(path, 1000) == b"x" * 1000
    with pytest.raises(DataError, match="longer than 999 bytes"):
        read_bytes(path, 999)


def test_what_is_no_regular_file_is_not_read(tmp_path: Path) -> None:
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)  # reading it would wait for ever for a writer
    link.symlink_to("/dev/zero")
    for path in (pipe, link, Path("/dev/zero"), Path("/dev/null")):
        with pytest.raises(DataError, match="is not a regular file"):
            read_bytes(path, 10)
    with pytest.raises(DataError, match="is a folder"):
        read_bytes(tmp_path, 10)


@pytest.mark.parametrize("name", ["no-such", "x" * 300, "a\0b", "", "no-folder/x"])
def test_a_name_that_cannot_be_is_one_sentence(name: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"cannot be (read|the name of a file)|is a folder"):
        read_text(tmp_path / name, 10)


def test_a_link_to_a_file_is_followed(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("whole")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    assert read_text(tmp_path / "b", 10) == "whole"


def test_a_gzip_bomb_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(gzip.compress(b"1,2,3\n" * 10_000_000, 6))  # 60 MB in 60 kB
    tracemalloc.start()
    try:
        with pytest.raises(DataError, match="unpacks to more than"):
            plain_lines(path)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 4 * (GZIP_FREE_BYTES + GZIP_RATIO * path.stat().st_size)


def test_a_table_of_measured_numbers_is_packed_far_less_than_the_limit(tmp_path: Path) -> None:
    """An hour in which nothing moves, at 1 kHz: the most compressible recording there is."""
    rows = b"".join(b"%.3f,250.0,140.0\n" % (k / 1000) for k in range(360_000))
    path = tmp_path / "still.csv.gz"
    path.write_bytes(gzip.compress(rows, 9))
    assert plain_lines(path) == rows


def test_a_line_without_end_is_refused_with_its_number(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"1,2\r\n" + b"9" * (LINE_BYTES + 1))
    with pytest.raises(DataError, match=r"a\.csv, line 2: is longer than"):
        plain_lines(path)


def test_line_ends_of_any_kind_become_one(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"1\r\n2\r3\n")
    assert plain_lines(tmp_path / "a") == b"1\n2\n3\n"


@pytest.mark.parametrize(
    "text", ["[" * 10_000 + "]" * 10_000, '{"a":' * 10_000 + "1" + "}" * 10_000, "[" * 34 + "]" * 34]
)
def test_deep_json_is_refused(text: str) -> None:
    with pytest.raises(DataError, match="nested too deep"):
        parse_json(text, "a.json")


@pytest.mark.parametrize("text", ['{"form": "double\\ud800"}', '{"\\udfff": 1}', '[["\\ud800"]]'])
def test_half_a_character_is_refused(text: str) -> None:
    with pytest.raises(DataError, match="half a character"):
        parse_json(text, "a.json")


def test_a_character_of_two_escapes_is_read() -> None:
    assert parse_json('"\\ud83d\\ude00"', "a.json") == "\U0001f600"


def test_json_as_deep_as_allowed_is_read() -> None:
    assert parse_json("[" * DEPTH + "]" * DEPTH, "a.json")


@pytest.mark.parametrize("text", ["a = " + "[" * 10_000 + "]" * 10_000, "a = " + "{b=" * 40 + "1" + "}" * 40])
def test_deep_toml_is_refused(text: str) -> None:
    with pytest.raises(DataError, match="nested too deep"):
        parse_toml(text, "a.toml")


@pytest.mark.parametrize("part", ["a", "'a b'", '"a"', "x" * 90])
def test_a_dotted_key_whose_reading_would_take_the_square_of_its_length_is_refused(part: str) -> None:
    for text in (".".join([part] * 20_000) + " = 1", f"[{' . '.join([part] * 20_000)}]"):
        with pytest.raises(DataError, match=f"more than {KEY_PARTS} parts"):
            parse_toml(text, "a.toml")


def test_dots_in_a_text_are_no_key() -> None:
    text = 'a = "one. two. three. ' + "four. " * 20 + '"\n# ' + "." * 200 + "\nb = 1.5"
    assert parse_toml(text, "a.toml")["b"] == 1.5


@pytest.mark.parametrize("digits", [40, 400, 5000])
def test_a_number_that_is_too_long_is_refused(digits: int) -> None:
    for parse, text in ((parse_json, '{"seed": %s}'), (parse_toml, "seed = %s")):
        with pytest.raises(DataError, match="number that is too long"):
            parse(text % ("9" * digits), "a")


def test_a_seed_of_128_bits_is_read() -> None:
    assert parse_json(str(WHOLE_MOST), "a.json") == WHOLE_MOST


def test_a_message_is_one_printable_line_whatever_a_file_s_keys_hold() -> None:
    error = DraglagError('key "a\nb\r\x1b[2J\u202e" is wrong', "correct\tit")
    assert str(error) == 'key "a b [2J " is wrong; correct it.'
