"""Session files (HDF5): write while recording, read, verify, salvage, and keep results beside the raw data."""

from draglag.store.analysis import StoredAnalysis, add_analysis, read_analyses, to_json
from draglag.store.migrate import migrate
from draglag.store.read import read_session
from draglag.store.salvage import Salvaged, final_name, partial_files, salvage
from draglag.store.verify import Finding, check_session, verify
from draglag.store.write import PARTIAL, SessionWriter, write_session

__all__ = [
    "PARTIAL",
    "Finding",
    "Salvaged",
    "SessionWriter",
    "StoredAnalysis",
    "add_analysis",
    "check_session",
    "final_name",
    "migrate",
    "partial_files",
    "read_analyses",
    "read_session",
    "salvage",
    "to_json",
    "verify",
    "write_session",
]
