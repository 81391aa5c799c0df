"""Sentences for people that keep their template, the id for translation."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from functools import reduce
from numbers import Number
from typing import Any

_LAST_PLACE = re.compile(r"(?<!{){(\w+)}$")


class Message(str):
    """A rendered sentence. ``template`` has places in braces (``{latency:.1f}``), filled by ``arguments``.

    Arguments other than messages, texts and numbers become text.
    """

    template: str
    arguments: Mapping[str, object]

    def __new__(cls, template: str, arguments: Mapping[str, object]) -> Message:
        kept = {name: value if isinstance(value, str | Number) else str(value) for name, value in arguments.items()}
        # Values are filled in once: braces within them are text.
        self = super().__new__(cls, template.format(**kept))
        self.template, self.arguments = template, kept
        return self

    def __reduce__(self) -> tuple[type[Message], tuple[str, Mapping[str, object]]]:
        return Message, (self.template, self.arguments)


def message(template: str, /, **arguments: object) -> Message:
    """A sentence from its English template, a literal."""
    return Message(template, arguments)


def phrase(text: str) -> Message:
    """A text as a message without places."""
    return text if isinstance(text, Message) else Message(text.replace("{", "{{").replace("}", "}}"), {})


def joined(separator: str, parts: Iterable[str]) -> Message:
    """Sentences or names one after the other, each still a message."""
    arguments = {f"part{number}": part for number, part in enumerate(parts, 1)}
    return Message(separator.join(f"{{{name}}}" for name in arguments), arguments)


def chained(template: str, parts: Iterable[str]) -> str:
    """The parts joined by a template such as ``{before} or {next}``."""
    return reduce(lambda before, part: Message(template, {"before": before, "next": part}), parts)


def cleaned(text: str, clean: Callable[[str], str]) -> Message:
    """The message with template and arguments changed by ``clean``."""
    if not isinstance(text, Message):
        return phrase(clean(text))
    arguments: dict[str, object] = {}
    for name, value in text.arguments.items():
        arguments[name] = cleaned(value, clean) if isinstance(value, Message) else value
        if type(value) is str:
            arguments[name] = clean(value)
    return Message(clean(text.template), arguments)


def without_stop(text: str) -> Message:
    """The message without final stops and blanks."""
    wanted = text.rstrip(". ")
    if wanted == text or not isinstance(text, Message):
        return phrase(text if wanted == text else wanted)
    template, arguments = text.template.rstrip(". "), dict(text.arguments)
    last = _LAST_PLACE.search(template)
    if last is not None and isinstance(value := arguments[last[1]], str):
        arguments[last[1]] = without_stop(value) if isinstance(value, Message) else value.rstrip(". ")
    shorter = Message(template, arguments)
    return shorter if shorter == wanted else phrase(wanted)


def packed(value: Any) -> Any:
    """The value for JSON, each message an object of template and arguments."""
    if isinstance(value, Message):
        return {"template": value.template, "arguments": packed(value.arguments)}
    if isinstance(value, Mapping):
        return {key: packed(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [packed(item) for item in value]
    return value


def unpacked(made: dict[str, Any]) -> Any:
    """A packed message, or any other object: the object_hook of ``json.loads``."""
    return Message(made["template"], made["arguments"]) if made.keys() == {"template", "arguments"} else made
