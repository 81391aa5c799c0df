"""Files by others: read, unpacked and parsed, each up to a limit."""

from draglag.reading.documents import checked, parse_json, parse_toml
from draglag.reading.files import plain_lines, read_bytes, read_text

__all__ = ["checked", "parse_json", "parse_toml", "plain_lines", "read_bytes", "read_text"]
