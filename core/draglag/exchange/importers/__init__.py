"""Readers of other programs' recordings, a file per format (docs/importing.md)."""

from draglag.exchange.importers.columns import ColumnMap, parse_map
from draglag.exchange.importers.session import FORMATS, HowToRead, format_of, laser_file_of, read_recordings

__all__ = ["FORMATS", "ColumnMap", "HowToRead", "format_of", "laser_file_of", "parse_map", "read_recordings"]
