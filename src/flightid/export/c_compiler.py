"""The C compiler of this machine, for shared libraries of exported models."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

from flightid.errors import ExportError

_NAMES = ("cc", "gcc", "clang")
_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off")
LONGEST_S = 300


def c_compiler() -> str | None:
    """Path of a C compiler: ``CC`` where it is set, else cc, gcc or clang; None without one.

    Example
    -------
    >>> c_compiler() is None or len(c_compiler()) > 0
    True
    """
    listed = [os.environ["CC"]] if os.environ.get("CC") else list(_NAMES)
    return next((found for name in listed if (found := shutil.which(name))), None)


def compile_library(sources: list[Path], library: Path, defines: tuple[str, ...] = ()) -> Path:
    """Compile C files to a shared library.

    Parameters
    ----------
    sources : list of Path
    library : Path
        File to make.
    defines : tuple of str
        Macros, as ``NAME=VALUE``.

    Returns
    -------
    Path
        `library`.

    Raises
    ------
    ExportError
        There is no compiler, or it refuses the code.
    """
    compiler = c_compiler()
    if compiler is None:
        raise ExportError(
            "there is no C compiler on this machine",
            needed=f"one of {', '.join(_NAMES)}, or CC in the environment",
            action="install one, or export the sources alone with compile=False",
        )
    arguments = [compiler, *_FLAGS, *(f"-D{each}" for each in defines)]
    arguments += ["-o", str(library), *map(str, sources), "-lm"]
    made = subprocess.run(arguments, capture_output=True, text=True, check=False, timeout=LONGEST_S)
    if made.returncode != 0:
        raise ExportError(
            "the C compiler refuses the exported code",
            found=made.stderr.strip()[-500:] or f"exit code {made.returncode}",
            action="report it with the model's file",
        )
    return library


def platform_tuple() -> str:
    """Name of this machine's folder in an FMU, for example ``x86_64-linux``.

    Reference
    ---------
    FMI 3.0.2, section 2.5.1.4.1.

    Example
    -------
    >>> platform_tuple().count("-")
    1
    """
    machine = platform.machine().lower()
    architecture = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    return f"{architecture}-{system}"


def library_suffix() -> str:
    """Suffix of a shared library on this system."""
    return {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
