"""Files by others, read up to limits."""

from draglag.reading.documents import checked, parse_json, parse_toml
from draglag.reading.files import plain_lines, read_bytes, read_text

__all__ = ["checked", "parse_json", "parse_toml", "plain_lines", "read_bytes", "read_text"]
