"""Session files (HDF5): record, write, read, verify, salvage; with results."""

from draglag.store.analysis import StoredAnalysis, add_analysis, read_analyses, to_json
from draglag.store.build import write_session
from draglag.store.journal import PARTIAL
from draglag.store.leftovers import clear_leftovers
from draglag.store.migrate import migrate
from draglag.store.read import open_columns, read_session, read_with_state
from draglag.store.salvage import Salvaged, final_name, partial_files, salvage
from draglag.store.state import FileState
from draglag.store.verify import Finding, check_session, grade, verify
from draglag.store.writer import SessionWriter

__all__ = [
    "PARTIAL",
    "FileState",
    "Finding",
    "Salvaged",
    "SessionWriter",
    "StoredAnalysis",
    "add_analysis",
    "check_session",
    "clear_leftovers",
    "final_name",
    "grade",
    "migrate",
    "open_columns",
    "partial_files",
    "read_analyses",
    "read_session",
    "read_with_state",
    "salvage",
    "to_json",
    "verify",
    "write_session",
]
