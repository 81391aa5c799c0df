"""The templates of every message in the sources, read from their syntax trees."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from string import Formatter

import draglag
import draglag_app
import draglag_devices
from draglag.errors import DraglagError
from draglag.messages import Message
from draglag_app.cli.main import COMMANDS

_SHELL = re.compile(
    rf"draglag (?:{'|'.join(COMMANDS)})\b|(?<![\w-])--[a-z]|\./run\b|"
    r"\b(?:sudo|pip|apt|fuser|ip link|usermod|systemctl)\b"
)
PACKAGES = (draglag, draglag_devices, draglag_app)
# Calls that take literal sentences, and at which places.
_TAKE_LITERALS = {"DeviceError": (1, 2), "Refusal": (1, 2)}
_MAKERS = {"message": (0,), "chained": (0,)}
# Calls of the windows that translate a literal, and at which place.
_MARKS = {"tr": 0, "translate": 1, "QT_TRANSLATE_NOOP": 1, "say": 1}


@dataclass(frozen=True)
class Sentence:
    """A template, or an expression where one should be, and where it stands."""

    file: str  # as draglag_app/session/saver.py
    line: int
    template: str | None
    """None where it is neither a literal nor made by ``message``: such a sentence cannot be translated."""


def error_classes() -> set[str]:
    """Names of all errors of draglag."""
    found, waiting = set(), [DraglagError]
    while waiting:
        kind = waiting.pop()
        found.add(kind.__name__)
        waiting += kind.__subclasses__()
    return found


@cache
def sentences() -> tuple[Sentence, ...]:
    """Every sentence given to ``message``, and every one that an error is raised with."""
    return tuple(_sentences())


def _sentences() -> Iterator[Sentence]:
    taking = dict.fromkeys(error_classes(), (0, 1)) | _TAKE_LITERALS
    for package in PACKAGES:
        root = Path(package.__file__).parent
        for path in sorted(root.rglob("*.py")):
            file = path.relative_to(root.parent).as_posix()
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                if not isinstance(node, ast.Call):
                    continue
                name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
                places = taking.get(name) or _MAKERS.get(name, ())
                for place in places:
                    for one in _alternatives(node.args[place]) if place < len(node.args) else ():
                        yield from _sentence(one, file, made=name in _MAKERS)


def _alternatives(node: ast.expr) -> list[ast.expr]:
    if isinstance(node, ast.IfExp):
        return [*_alternatives(node.body), *_alternatives(node.orelse)]
    if isinstance(node, ast.BoolOp):
        return [one for value in node.values for one in _alternatives(value)]
    return [node]


def _sentence(node: ast.expr, file: str, made: bool) -> Iterator[Sentence]:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        text = node.value if made else node.value.rstrip(". ").replace("{", "{{").replace("}", "}}")
        yield Sentence(file, node.lineno, text)
    elif isinstance(node, ast.JoinedStr | ast.BinOp) or (made and not isinstance(node, ast.Constant)):
        yield Sentence(file, node.lineno, None)


def shell_command(text: str) -> str:
    """The first command or option for a terminal in a text; empty if there is none."""
    found = _SHELL.search(text)
    return "" if found is None else found[0]


@cache
def texts_of_windows() -> frozenset[str]:
    """Every string that the windows pass to a translating function."""
    found = set()
    for file in (Path(draglag_app.__file__).parent / "windows").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            place = _MARKS.get(name)
            if place is None:
                continue
            for argument in node.args[min(place, len(node.args) - 1) :][:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str) and argument.value.strip():
                    found.add(argument.value)
    return frozenset(found)


def example(template: str) -> Message:
    """A message of that template, with a number or a word that looks like no English in each place."""
    places = [(name, spec) for _, name, spec, _ in Formatter().parse(template) if name]
    return Message(template, {name: 7.5 if spec else f"X{k}Y" for k, (name, spec) in enumerate(places)})


def has_words(template: str) -> bool:
    """Whether there is anything to translate apart from what is filled in."""
    return any(re.search("[A-Za-z]{2}", text) for text, _, _, _ in Formatter().parse(template))
