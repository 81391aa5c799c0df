"""JSON Schema and page of a session file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from draglag.store import nexus, schema
from draglag.store.schema import Table


@dataclass(frozen=True)
class Place:
    """A kind of group. ``attributes``: name → (type, meaning); {…} in the path stands for a name."""

    path: str
    what: str
    attributes: dict[str, tuple[str, str]]
    table: Table | None = None
    texts: tuple[str, ...] = ()
    optional: bool = True


_TEXT, _NUMBER, _WHOLE = "text", "number", "whole number"
_GAPS = "stretches in which the stream is known to be incomplete"
PLACES = (
    Place("/", "the session", {
        "schema": (_TEXT, f"“{schema.SCHEMA}”"), "schema_version": (_WHOLE, f"{schema.VERSION}"),
        "name": (_TEXT, "of the session"), "started_utc": (_TEXT, "ISO 8601"),
        "started_s": (_NUMBER, "what the host's clock read then, s (where known)"),
        "clock": (_TEXT, "which clock times are on"), "software": (_TEXT, "what recorded it"),
        "seed": (_WHOLE, "of the protocol or the simulation (where there is one; text beyond 64 bits)"),
        "raw_sha256": (_TEXT, "checksum of the raw data"),
    }, texts=("protocol_toml",), optional=False),
    Place("/screen", "the panel under test", {
        "name": (_TEXT, ""), "width_mm": (_NUMBER, "active area, mm"), "height_mm": (_NUMBER, "active area, mm"),
        "width_px": (_WHOLE, "picture"), "height_px": (_WHOLE, "picture"),
    }, optional=False),
    Place("/stylus", "the stylus", {"name": (_TEXT, ""), "diameter_mm": (_NUMBER, "mm")}, optional=False),
    Place("/beam", "the beam as the operator measured it, y = slope · x + intercept_mm",
          {"slope": (_NUMBER, ""), "intercept_mm": (_NUMBER, "mm")}),
    Place("/devices", "an attribute a device: role → address and description", {}, optional=False),
    Place("/details", "an attribute a detail of the session: participant, session, operator, and free fields", {}),
    Place("/calibration", "touched targets, and the affine from device units to mm", {
        "device": (_TEXT, "name of the touchscreen"), "made_utc": (_TEXT, "ISO 8601"),
        **dict.fromkeys(schema.AFFINE, (_NUMBER, "of the affine")),
    }, schema.CALIBRATION),
    Place("/clocks/{stream}", "a device's clock seen from the host's", {"stream": (_TEXT, "its name")}, schema.CLOCK),
    Place("/taps", "taps timed by a WALT", {}, schema.TAPS),
    Place("/taps/rejected", "an attribute a reason: how many taps were seen and not used", {}),
    Place("/notes", "what happened, and the operator's words", {}, schema.LOG),
    Place("/runs", "all runs", {}, optional=False),
    Place("/runs/{run}", "one run", {
        "protocol": (_TEXT, "circle, chirp, multisine, step or free"), "start_s": (_NUMBER, "host clock, s"),
        "duration_s": (_NUMBER, "s"), "outcome": (_TEXT, "complete, aborted, device_lost or failed"),
        "nominal_speed_mm_s": (_NUMBER, "mm/s (where there is one)"), "radius_mm": (_NUMBER, "mm (where there is one)"),
        "seed": (_WHOLE, "(where there is one)"),
    }),
    Place("/runs/{run}/target", "an attribute a parameter of the target", {}, optional=False),
    Place("/runs/{run}/touch", "touch events", {"dropped": (_WHOLE, "events known to be lost")}, schema.TOUCH,
          optional=False),
    Place("/runs/{run}/touch/gaps", _GAPS, {}, schema.GAPS),
    Place("/runs/{run}/touch/axes", "the touchscreen's axes as the kernel describes them", {}, schema.AXES),
    Place("/runs/{run}/laser", "edges of the laser sensor", {"missed": (_WHOLE, "edges known to be missing")},
          schema.LASER, optional=False),
    Place("/runs/{run}/laser/gaps", _GAPS, {}, schema.GAPS),
    Place("/runs/{run}/display", "where the target was drawn", {"missed": (_WHOLE, "frames that came too late")},
          schema.DISPLAY),
    Place("/runs/{run}/sync/{stream}", "as /clocks, during the run", {"stream": (_TEXT, "its name")}, schema.CLOCK),
    Place("/runs/{run}/log", "what happened in the run", {}, schema.LOG),
    Place("/analysis/{n}", "a stored result; each of its lists of records is a table of its name", {
        "software": (_TEXT, "what made it"), "created_utc": (_TEXT, "ISO 8601"),
        "input_sha256": (_TEXT, "checksum of the raw data it was made from"),
    }, texts=("options_json", "result_json")),
)  # fmt: skip
_JSON_TYPES = {_TEXT: ["string"], _NUMBER: ["number"], _WHOLE: ["integer", "string"]}


def layout_schema() -> dict[str, Any]:
    """JSON Schema of ``layout_of``."""
    patterns = {_pattern(place.path): _place_schema(place) for place in PLACES}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"draglag session file, schema version {schema.VERSION}, as JSON",
        "type": "object",
        "patternProperties": patterns | {r"^/analysis$|^/clocks$|/sync$|^/analysis/\d+/\w+$": {"type": "object"}},
        "additionalProperties": False,
        "required": [place.path for place in PLACES if not place.optional and "{" not in place.path],
    }


def layout_of(file: Any) -> dict[str, Any]:
    """An open session file as JSON: path → {"attributes": …, "columns": name → {"type", "units"}}."""
    groups: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if hasattr(item, "shape"):
            parent, _, column = f"/{name}".rpartition("/")
            about = {"type": item.dtype.kind, "units": item.attrs["units"].decode(), "rank": len(item.shape)}
            groups.setdefault(parent or "/", {"attributes": {}, "columns": {}})["columns"][column] = about
        else:
            groups[f"/{name}"] = {"attributes": _attributes(item), "columns": {}}

    groups["/"] = {"attributes": _attributes(file), "columns": {}}
    file.visititems(visit)
    return groups


def page() -> str:
    """The page on the session file, Markdown."""
    lines = [
        "# The session file",
        "",
        "<!-- Made by ./run schemas from draglag.schemas.session_file and draglag.store.schema. -->",
        "",
        f"HDF5, one file a session, schema version {schema.VERSION}: one-dimensional columns over a dimension scale,",
        "with `units` and `long_name` on each; only 64-bit floats and integers and texts of fixed length (UTF-8 bytes,",
        "`_Encoding`). Raw data are never changed; the checksum `raw_sha256` covers all but `/analysis`.",
        "Version 1 differs in the type of its texts and has no attributes of NeXus; it is read as well.",
        f"Groups also carry attributes of NeXus ({', '.join(f'`{name}`' for name in nexus.ATTRIBUTES)}),",
        "by which viewers know what to draw.",
        "How other programs read it: [files.md](files.md).",
        "As JSON Schema: [session-file.json](schemas/session-file.json).",
    ]
    for place in PLACES:
        lines += ["", f"## `{place.path}`", f"{place.what[:1].upper()}{place.what[1:]}."]
        if place.attributes:
            lines += ["", "| attribute | type | |", "|---|---|---|"]
            lines += [f"| `{name}` | {kind} | {text} |" for name, (kind, text) in place.attributes.items()]
        if place.texts:
            lines += ["", "| text | |", "|---|---|"]
            lines += [f"| `{name}` | {schema.TEXTS[name]} |" for name in place.texts]
        if place.table is not None:
            lines += ["", "| column | type | units | |", "|---|---|---|---|"]
            lines += map(_column_line, place.table.every())
    return "\n".join(lines) + "\n"


def _column_line(column: schema.Column) -> str:
    optional = " (optional)" if column.optional else ""
    return f"| `{column.name}`{optional} | {_kind(column.kind)} | {column.units} | {column.meaning} |"


def _kind(kind: str) -> str:
    return {"f": "float64", "i": "int64"}.get(kind, f"text, {kind[1:]} bytes")


def _pattern(path: str) -> str:
    text = path.replace("{n}", r"\d+").replace("{run}", "[^/]+").replace("{stream}", "[^/]+")
    return f"^{text}$"


def _place_schema(place: Place) -> dict[str, Any]:
    known = {name: {"type": _JSON_TYPES[kind]} for name, (kind, _) in place.attributes.items()}
    required = [name for name, (_, text) in place.attributes.items() if "(where" not in text]
    columns = {} if place.table is None else {column.name: _column_schema(column) for column in place.table.every()}
    columns |= {name: {"properties": {"type": {"const": "S"}, "rank": {"const": 0}}} for name in place.texts}
    needed = [] if place.table is None else [one.name for one in place.table.every() if not one.optional]
    return {
        "description": place.what,
        "type": "object",
        "properties": {
            "attributes": {"type": "object", "properties": known, "required": required},
            "columns": {"type": "object", "properties": columns, "required": needed, "additionalProperties": False},
        },
        "required": ["attributes", "columns"],
    }


def _column_schema(column: schema.Column) -> dict[str, Any]:
    about = {"type": {"const": column.kind[0]}, "units": {"const": column.units}, "rank": {"const": 1}}
    return {"description": column.meaning, "properties": about, "required": list(about)}


def _attributes(item: Any) -> dict[str, Any]:
    known = {}
    for key in item.attrs:
        value = item.attrs[key]
        if getattr(value, "shape", ()) == ():
            known[key] = value.decode() if isinstance(value, bytes) else value.item()
    return known
