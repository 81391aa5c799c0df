"""What a pydantic model refuses, in messages that can be translated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from draglag.errors import message_of
from draglag.messages import Message, message, phrase

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

_NUMBER, _WHOLE, _TEXT = message("expected a number"), message("expected a whole number"), message("expected a text")
_TRUTH, _LIST = message("expected true or false"), message("expected a list […]")
_TABLE, _OBJECT = message("expected a table of keys"), message("expected an object {{…}}")
_FIXED: Mapping[str, Message] = {
    "missing": message("is missing"),
    "extra_forbidden": message("there is no such key"),
    "float_type": _NUMBER,
    "float_parsing": _NUMBER,
    "finite_number": message("expected a finite number"),
    "int_type": _WHOLE,
    "int_parsing": _WHOLE,
    "int_from_float": _WHOLE,
    "string_type": _TEXT,
    "bool_type": _TRUTH,
    "bool_parsing": _TRUTH,
    "list_type": _LIST,
    "tuple_type": _LIST,
}
_TABLES = ("dict_type", "model_type", "model_attributes_type", "mapping_type")
_LIMITED: Mapping[str, Callable[[Mapping[str, Any]], Message]] = {
    "greater_than": lambda at: message("expected a number greater than {limit:g}", limit=at["gt"]),
    "greater_than_equal": lambda at: message("expected a number of at least {limit:g}", limit=at["ge"]),
    "less_than": lambda at: message("expected a number less than {limit:g}", limit=at["lt"]),
    "less_than_equal": lambda at: message("expected a number of at most {limit:g}", limit=at["le"]),
    "string_too_short": lambda at: message("expected a text of at least {least} characters", least=at["min_length"]),
    "string_too_long": lambda at: message("expected a text of at most {most} characters", most=at["max_length"]),
    "too_short": lambda at: message("expected at least {least} values", least=at["min_length"]),
    "too_long": lambda at: message("expected at most {most} values", most=at["max_length"]),
    "literal_error": lambda at: _one_of(at["expected"]),
}


def refusal(fault: ErrorDetails, json: bool = False) -> Message:
    """What is wrong with a value, without its place; of a type that is unknown here, pydantic's own English.

    ``json``: whether the file is JSON, which calls a table an object.
    """
    kind, details = fault["type"], fault.get("ctx", {})
    if kind in _TABLES:
        return _OBJECT if json else _TABLE
    if kind in _FIXED:
        return _FIXED[kind]
    if kind in _LIMITED:
        return _LIMITED[kind](details)
    if isinstance(refused := details.get("error"), ValueError):  # what a validator of ours raised
        return message_of(refused)
    return phrase(fault["msg"][:1].lower() + fault["msg"][1:])


def _one_of(expected: str) -> Message:
    if " or " not in expected:
        return message("expected {value}", value=expected)
    return message("expected one of {values}", values=expected.replace(" or ", ", "))
