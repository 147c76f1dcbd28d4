"""Typed errors: each says what was found, what was needed, and what to do next.

Every class keeps a built-in parent, so code that catches `ValueError` or `OSError` keeps working.
The native halves raise these same classes (`crates/python/src/error.rs`).
"""

from __future__ import annotations

from flightid.surface import spoken


class FlightidError(Exception):
    """Root of every error that flightid raises on purpose.

    Parameters
    ----------
    problem : str
        What is wrong, in one clause.
    found : object, optional
        The value or state that was met.
    needed : object, optional
        What would have been accepted.
    action : str, optional
        What the user can do next.

    Example
    -------
    >>> print(DataError("sample time is not uniform", found="jitter 12 %", needed="below 1 %",
    ...                 action="resample with conditioning.resample"))
    sample time is not uniform: found jitter 12 %; needed below 1 %. Next: resample with
    conditioning.resample.
    """

    def __init__(
        self,
        problem: str,
        *,
        found: object = None,
        needed: object = None,
        action: str | None = None,
    ) -> None:
        self.problem = problem
        self.found = found
        self.needed = needed
        self.action = action
        clauses = []
        if found is not None:
            clauses.append(f"found {found}")
        if needed is not None:
            clauses.append(f"needed {needed}")
        text = problem + (": " + "; ".join(clauses) if clauses else "")
        if action:
            text += f". Next: {action}."
        super().__init__(spoken(text))

    @property
    def reason(self) -> str:
        """What is wrong and what was found, without what to do."""
        return self.problem if self.found is None else f"{self.problem}: found {self.found}"


class DataError(FlightidError, ValueError):
    """Samples, stamps or spectra that cannot mean what they are said to mean."""


class ShapeError(DataError):
    """Two shapes that must agree do not."""


class OptionError(FlightidError, ValueError):
    """An option outside the range that has a meaning."""


class UnitError(FlightidError, ValueError):
    """Two units that clash, or a unit that is not known."""


class UnknownNameError(FlightidError, KeyError):
    """A channel, parameter, message or model name that does not exist here."""

    def __str__(self) -> str:
        """Plain sentence; `KeyError` alone would print its repr."""
        return str(self.args[0])


class LogFormatError(FlightidError, ValueError):
    """A file that is not the log it was taken for."""


class MissingColumnError(UnknownNameError):
    """A message, instance or field that a log does not hold."""


class SingularError(FlightidError, ArithmeticError):
    """A linear system without a solution to working precision."""


class ModelError(FlightidError, ValueError):
    """A model that contradicts itself: equations, units, bounds or ties."""


class FitError(FlightidError, RuntimeError):
    """A fit that cannot start or did not end in an optimum that means something."""


class StudyError(FlightidError, ValueError):
    """A study file that cannot be carried out as written."""


class FileFormatError(FlightidError, ValueError):
    """A record or model file whose content is not what its name says."""


class ExportError(FlightidError, ValueError):
    """A model that has no counterpart in the format asked for, or a tool that is missing for it."""
