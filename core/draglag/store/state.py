"""Which file a session was read from, and in which state."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

Identity = tuple[int, int, int, int, int]


@dataclass(frozen=True)
class FileState:
    """A file as it was read. raw_sha256: checksum of its raw data.

    A file of the same identity has been checked, and has that checksum.
    """

    identity: Identity | None
    raw_sha256: str


def file_identity(path: Path) -> Identity | None:
    """Device, inode, size (bytes), times of the last change of content and of state (ns); None without a file."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns
