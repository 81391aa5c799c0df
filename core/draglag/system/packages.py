"""Missing packages, and the line that installs them."""

from __future__ import annotations

import importlib.util
import platform
import sys
from dataclasses import dataclass

from draglag.errors import DraglagError
from draglag.messages import message


@dataclass(frozen=True)
class Package:
    """A package by its name for pip; ``extra``: draglag's extra with it."""

    name: str
    extra: str = ""

    @property
    def line(self) -> str:
        """The command that installs it."""
        # With double quotes, which every shell knows, also that of Windows.
        return f'pip install "draglag[{self.extra}]"' if self.extra else f"pip install {self.name}"


_EVDEV_WHEEL = sys.platform == "linux" and platform.machine() == "x86_64" and sys.version_info < (3, 14)

# Import name → package, as pyproject.toml asks for them: a test compares the two.
PACKAGES = {
    "numpy": Package("numpy"),
    "scipy": Package("scipy"),
    "threadpoolctl": Package("threadpoolctl"),
    "h5py": Package("h5py"),
    "pydantic": Package("pydantic"),
    "click": Package("click"),
    "jinja2": Package("jinja2"),
    "joblib": Package("joblib"),
    "platformdirs": Package("platformdirs"),
    "tomli_w": Package("tomli-w"),
    "PySide6": Package("PySide6-Essentials", "gui"),
    "pyqtgraph": Package("pyqtgraph", "gui"),
    "evdev": Package("evdev-binary" if _EVDEV_WHEEL else "evdev", "devices"),
    "pysoem": Package("pysoem", "devices"),
    "serial": Package("pyserial", "devices"),
    "matplotlib": Package("matplotlib", "report"),
    "pandas": Package("pandas", "frames"),
    "pyarrow": Package("pyarrow", "frames"),
    "xarray": Package("xarray", "frames"),
    "h5netcdf": Package("h5netcdf", "netcdf"),
    "pyxdf": Package("pyxdf", "xdf"),
    "pylsl": Package("pylsl", "lsl"),
    "distributed": Package("distributed", "cluster"),
}


def package_of(module: str) -> Package | None:
    """The package that brings a module, if draglag uses it."""
    return PACKAGES.get(module.partition(".")[0])


def advice(module: str) -> tuple[str, str]:
    """Problem and remedy for a missing module."""
    package = package_of(module)
    if package is None:
        return message("the Python module {name} is missing", name=module), message("install draglag again")
    problem = message(
        "the Python package {name} (extra {extra}) is not installed"
        if package.extra
        else "the Python package {name} is not installed",
        name=package.name,
        extra=package.extra,
    )
    return problem, message("run: {command}", command=package.line)


def missing_package(error: ModuleNotFoundError) -> DraglagError | None:
    """The error if a known package is missing; None for a mistake of the program."""
    if package_of(error.name or "") is None:
        return None
    return DraglagError(*advice(error.name or ""))


def need(*modules: str) -> None:
    """Raise DraglagError if one of these modules is missing."""
    for module in modules:
        if not _is_there(module):
            raise DraglagError(*advice(module))


def _is_there(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ValueError:  # sys.modules marks it as missing
        return False
