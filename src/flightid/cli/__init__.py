"""The command line: each verb a thin face of one function of the package.

A verb is a file ``cli/<verb>.py`` that exposes a click ``command``; `program` finds it. Such a file
imports click and `flightid.cli.output` at its head and everything else inside its function, since
``flightid --help`` loads all of them.

Conventions: results go to standard output, as text or, with ``--json``, as one JSON document;
progress and notes go to standard error. Exit codes: 0 done; 1 done, and a verdict is red; 2 the
command or its input cannot be used; 70 a fault in flightid itself; 130 interrupted. A command that
fails leaves no half-written output.
"""

from __future__ import annotations

from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave with its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Arguments after the program's name; default: those of this process.
    """
    from flightid.cli.program import run

    raise SystemExit(run(arguments))
