"""A PID controller as portable C: the recursion of `PidLoop.run`, with its gains as numbers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from flightid.control.autopilots.pid_loop import PidLoop
from flightid.errors import ExportError
from flightid.export.c_source import c_environment, file_stem
from flightid.export.exported import ExportFiles
from flightid.export.names import comment, identifier
from flightid.files import write_atomically
from flightid.version import VERSION


def export_pid(loop: PidLoop, path: Path, name: str, remarks: Iterable[str] = ()) -> ExportFiles:
    """Write header and source of a sampled controller; further remarks stand above its own.

    Raises
    ------
    ExportError
        The controller is continuous: it has no recursion.
    OptionError
        The name of the file is none that a header can carry.
    """
    if not loop.sampled:
        raise ExportError(
            "a continuous controller has no recursion that code could run",
            found="no rate",
            needed="the rate of the controller",
            action="tune it again with loop_rate_hz",
        )
    step, stem = 1.0 / loop.loop_rate_hz, file_stem(path)
    tracking = loop.values.get("tracking_s", 0.0)
    words = {
        "title": comment(name), "output": comment(loop.axis), "prefix": identifier(name),
        "remarks": [comment(each.replace("−", "-")) for each in (*remarks, *loop.remarks())],
        "version": VERSION, "stem": stem,
        "step": step, "sense": "-1.0" if loop.direct else "1.0",
        "back": min(1.0, step / tracking) if tracking else 0.0,
        "reach": None if loop.rate_per_s is None else loop.rate_per_s * step,
        "low": loop.low, "high": loop.high, "lag": loop.values["filter_s"],
        **{letter: loop.values[letter] for letter in "bc"},
        **{f"k{letter}": loop.values.get(letter, 0.0) for letter in "pid"},
    }  # fmt: skip
    texts = [c_environment().get_template(f"pid.{end}.j2").render(words) for end in ("h", "c")]
    header = write_atomically(path.with_suffix(".h"), texts[0])
    source = write_atomically(path.with_suffix(".c"), texts[1])
    facts = {
        "prefix": str(words["prefix"]),
        "step": f"{step:g} s",
        "build": f"cc -std=c99 -O2 -c {source.name}",
    }
    return ExportFiles("c", (source, header), facts)
