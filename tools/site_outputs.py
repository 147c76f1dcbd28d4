"""Runs the Python of a page while the site is built and shows what it prints.

Pages run as their test runs them: in order, one namespace a page, in an empty folder that holds
``demo-output/flight.bin`` where the page names it. An example that fails fails the build.
"""

from __future__ import annotations

import io
import re
import tempfile
import tomllib
from collections.abc import Callable
from contextlib import chdir, redirect_stdout
from functools import cache
from pathlib import Path

BLOCK = re.compile(r"^```python\n(.*?)^```\n", re.MULTILINE | re.DOTALL)
STUDY = Path(__file__).parent.parent / "examples" / "quadrotor_rig" / "study.toml"


@cache
def _demo_output() -> tempfile.TemporaryDirectory[str]:
    """Folder with the log of the demo's flight, made once for all pages."""
    from flightid.vehicles import (  # noqa: PLC0415
        PilotDoublet,
        SidActivation,
        fly,
        write_ardupilot_log,
    )

    plan = tomllib.loads(STUDY.read_text(encoding="utf-8"))["flight"]
    flight = fly(
        runs=[SidActivation(**row) for row in plan["sweep"]],
        doublets=[PilotDoublet(**row) for row in plan["doublet"]],
        log_every=plan["log_every"],
        seed=plan["seed"],
    )
    folder = tempfile.TemporaryDirectory()
    write_ardupilot_log(flight, Path(folder.name) / "flight.bin")
    return folder


def _runner(page: str) -> Callable[[re.Match[str]], str]:
    """Replaces a block by itself and what it prints, in one namespace a page."""
    namespace: dict[str, object] = {"__name__": page}

    def run(match: re.Match[str]) -> str:
        printed = io.StringIO()
        with redirect_stdout(printed):
            exec(compile(match.group(1), page, "exec"), namespace)
        text = printed.getvalue().rstrip()
        return match.group(0) + (f"\n``` {{ .text .output }}\n{text}\n```\n" if text else "")

    return run


def with_outputs(markdown: str, page: str) -> str:
    """Show under each block of Python what it prints.

    Parameters
    ----------
    markdown : str
        Text of the page.
    page : str
        Its name, for tracebacks.

    Returns
    -------
    str
        The text with a block of output after each block that prints.
    """
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        if "demo-output/" in markdown:
            Path("demo-output").symlink_to(_demo_output().name)
        return BLOCK.sub(_runner(page), markdown)
