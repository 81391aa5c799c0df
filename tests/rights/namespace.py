"""A mount namespace with a root-owned installation of draglag, in which installers may write and users may attack."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
USER = 1000
# The installation holds draglag itself; of pysoem, which needs a compiler's output, only what importing it takes.
_SETUP = r"""
set -e
mount --make-rprivate /
mount -t tmpfs -o mode=755 tmpfs /mnt
for place in etc opt home usr/local; do
    layer=/mnt/$(echo "$place" | tr / _)
    mkdir -p "$layer/upper" "$layer/work"
    mount -t overlay overlay -o "lowerdir=/$place,upperdir=$layer/upper,workdir=$layer/work" "/$place"
done
chmod 755 /opt /home /usr/local
mkdir -p /usr/local/lib /home/user /opt/shared
chmod 755 /usr/local/lib
chown 1000:1000 /home/user
getent group draglag >/dev/null || groupadd --system draglag
python3 -I -m venv --without-pip /opt/draglag
site=$(echo /opt/draglag/lib/python3*/site-packages)
for package in core/draglag devices/draglag_devices resources/draglag_resources; do
    cp -R --no-preserve=mode,ownership "$1/$package" "$site"
done
mkdir "$site/pysoem" "$site/draglag-0.dist-info"
echo 'import os, time
if os.path.exists("/opt/shared/slow"): time.sleep(30)
def __getattr__(name): return 8' >"$site/pysoem/__init__.py"
printf 'Metadata-Version: 2.1\nName: draglag\nVersion: 0\n' >"$site/draglag-0.dist-info/METADATA"
chmod -R go-w /opt/draglag
echo made
exec cat
"""


def why_not() -> str:
    """Why there is no use in trying to make such a namespace here; empty where there may be."""
    if os.geteuid() != 0:
        return "the installers need root"
    for tool in ("unshare", "nsenter", "setpriv", "setcap", "cc", "groupadd"):
        if shutil.which(tool, path="/usr/sbin:/usr/bin:/sbin:/bin") is None:
            return f"{tool} is missing"
    return ""


class World:
    """The namespace and its contents; both end with the ``with`` block. Raises RuntimeError where the kernel forbids
    it."""

    def __enter__(self) -> World:
        self._process = subprocess.Popen(
            ["unshare", "--mount", "sh", "-c", _SETUP, "setup", str(ROOT)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env={"PATH": "/usr/sbin:/usr/bin:/sbin:/bin"},
        )  # fmt: skip
        assert self._process.stdout is not None
        if self._process.stdout.readline() != "made\n":
            _, complaint = self._process.communicate()
            raise RuntimeError(f"no namespace of one's own: {complaint.strip().splitlines()[-1:]}")
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()

    def command(self, *command: str) -> list[str]:
        """A command line that runs in the namespace."""
        return ["nsenter", f"--mount=/proc/{self._process.pid}/ns/mnt", f"--wd={ROOT}", *command]

    def sh(self, script: str) -> subprocess.CompletedProcess[str]:
        """A script as root."""
        return subprocess.run(self.command("sh", "-c", script), capture_output=True, text=True, check=False)

    def as_user(self, script: str, member: bool = True) -> subprocess.CompletedProcess[str]:
        """A script as a user who owns /home/user, in the group draglag or not."""
        return subprocess.run(self.user_command(script, member), capture_output=True, text=True, check=False)

    def user_command(self, script: str, member: bool = True) -> list[str]:
        groups = "$(getent group draglag | cut -d: -f3)" if member else ""
        keep = f'--groups "{groups}"' if member else "--clear-groups"
        return self.command("sh", "-c", f'exec setpriv --reuid={USER} --regid={USER} {keep} sh -c "$1"', "sh", script)

    def install(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return self.sh(" ".join(["packaging/ethercat/install.sh", *arguments]))
