"""Starts the privileged process that runs the bus."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import IO

from draglag_devices.ethercat_laser.preflight import has_rights

# Set up by ``draglag-ethercat-setup`` of the Debian package, or by ``./run install``; carries the two capabilities and
# starts only ``master``.
LAUNCHERS = (
    Path("/usr/lib/draglag/draglag-ethercat-master"),
    Path("/usr/local/lib/draglag/draglag-ethercat-master"),
)
_MODULE = "draglag_devices.ethercat_laser.master"


def command(*arguments: str) -> list[str]:
    """The command line: this interpreter, or the launcher if it lacks rights."""
    if not has_rights():
        for launcher in LAUNCHERS:
            if os.access(launcher, os.X_OK):
                return [str(launcher), *arguments]
    # -P: modules in the present directory must not end up in a privileged process.
    return [sys.executable, "-P", "-m", _MODULE, *arguments]


def start(*arguments: str, complaints: IO[bytes]) -> subprocess.Popen[bytes]:
    """The started process. Raises OSError."""
    return subprocess.Popen(
        command(*arguments), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=complaints, bufsize=0
    )
