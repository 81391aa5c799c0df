"""A small virtual machine with Debian's kernel; one command runs on the host's files (read only).

Needs qemu (no KVM), a kernel with its modules, and a C compiler for the first process.
"""

from __future__ import annotations

import lzma
import os
import re
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

HERE = Path(__file__).parent
MODULES = ("virtio_pci", "9pnet_virtio", "9p", "evdev", "uinput")
QEMU = "qemu-system-x86_64"
_TRAILER = "TRAILER!!!"


def kernels() -> list[Path]:
    """Roots (``/`` or a folder that a kernel's package was unpacked in) that hold a kernel with its modules."""
    roots = [Path(os.environ["DRAGLAG_KERNEL"])] if os.environ.get("DRAGLAG_KERNEL") else [Path("/")]
    return [root for root in roots if _images(root)]


def _images(root: Path) -> list[tuple[Path, Path]]:
    """(kernel, folder of its modules) where the modules for touch input are all there."""
    found = []
    for image in sorted(root.glob("boot/vmlinuz-*"), reverse=True):
        modules = root / "lib/modules" / image.name.removeprefix("vmlinuz-")
        if os.access(image, os.R_OK) and any(modules.rglob("uinput.ko*")):
            found.append((image, modules))
    return found


def why_not() -> str:
    """Why no machine can run here, or an empty string."""
    if shutil.which(QEMU) is None:
        return f"{QEMU} is missing: sudo apt-get install -y qemu-system-x86"
    if shutil.which("gcc") is None:
        return "gcc is missing: sudo apt-get install -y gcc libc6-dev"
    if not kernels():
        return "there is no kernel with the module uinput: ./run test-kernel gets one"
    return ""


def _plain(path: Path) -> bytes:
    data = path.read_bytes()
    if path.suffix == ".xz":
        return lzma.decompress(data)
    if path.suffix == ".zst":
        return subprocess.run(["zstd", "-dc", str(path)], capture_output=True, check=True).stdout
    return data


def needed_modules(folder: Path, names: Iterable[str] = MODULES) -> list[tuple[str, bytes]]:
    """Modules with all they depend on, in the order in which they must be loaded; built-in ones are left out."""
    paths = {re.sub(r"\.ko(\.\w+)?$", "", path.name).replace("-", "_"): path for path in folder.rglob("*.ko*")}
    order: list[tuple[str, bytes]] = []

    def add(name: str) -> None:
        if name not in paths or any(known == name for known, _ in order):
            return
        data = _plain(paths[name])
        depends = re.search(rb"\0depends=([^\0]*)\0", data)
        for other in depends[1].decode().split(",") if depends and depends[1] else ():
            add(other.replace("-", "_"))
        order.append((name, data))

    for name in names:
        add(name)
    return order


def _entry(name: str, data: bytes, mode: int, number: int, device: tuple[int, int] = (0, 0)) -> bytes:
    """One file of a cpio archive (newc)."""
    fields = (number, mode, 0, 0, 1, 0, len(data), 0, 0, *device, len(name) + 1, 0)
    head = b"070701" + b"".join(b"%08X" % field for field in fields) + name.encode() + b"\0"
    return head + bytes(-len(head) % 4) + data + bytes(-len(data) % 4)


def initrd(folder: Path, modules: list[tuple[str, bytes]], command: list[str], work_in: Path) -> Path:
    """The first file system: our first process, the modules, and what to run."""
    init = folder / "init"
    subprocess.run(["gcc", "-O1", "-static", "-o", str(init), str(HERE / "init.c")], check=True)
    files = [("dev", b"", 0o040755, (0, 0)), ("dev/console", b"", 0o020600, (5, 1)),
             ("init", init.read_bytes(), 0o100755, (0, 0)),
             ("modules", "".join(f"/{name}.ko\n" for name, _ in modules).encode(), 0o100644, (0, 0)),
             ("command", "".join(f"{word}\n" for word in [str(work_in), *command]).encode(), 0o100644, (0, 0)),
             *((f"{name}.ko", data, 0o100644, (0, 0)) for name, data in modules),
             (_TRAILER, b"", 0, (0, 0))]  # fmt: skip
    archive = b"".join(_entry(name, data, mode, k + 1, device) for k, (name, data, mode, device) in enumerate(files))
    path = folder / "initrd"
    path.write_bytes(archive)
    return path


def run(folder: Path, command: list[str], work_in: Path, patience_s: float) -> tuple[int, str]:
    """Boot, run the command, power off. Returns its exit code (−1: it never ended) and all the machine said."""
    image, modules = _images(kernels()[0])[0]
    archive = initrd(folder, needed_modules(modules), command, work_in)
    machine = [QEMU, "-machine", "pc,accel=tcg", "-cpu", "max", "-smp", "2", "-m", "768", "-nographic", "-no-reboot",
               "-nodefaults", "-serial", "stdio", "-kernel", str(image), "-initrd", str(archive), "-append",
               "console=ttyS0 quiet panic=-1 mitigations=off tsc=reliable random.trust_cpu=on", "-virtfs",
               "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap"]  # fmt: skip
    try:
        done = subprocess.run(machine, capture_output=True, text=True, errors="replace", timeout=patience_s)
    except subprocess.TimeoutExpired as late:
        said = late.stdout or b""
        return -1, said.decode(errors="replace") if isinstance(said, bytes) else said
    ended = re.search(r"EXIT (\d+)", done.stdout)
    return (int(ended[1]) if ended else -1), done.stdout + done.stderr
