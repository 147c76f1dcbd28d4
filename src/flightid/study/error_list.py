"""Errors of a study file, all of them at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import field
from typing import Any, TypeVar

from flightid.errors import FlightidError, StudyError
from flightid.frozen import dataclass

Part = TypeVar("Part")


class CollectedStudyError(StudyError):
    """Errors that are told together; a list of errors takes them one by one.

    Attributes
    ----------
    errors : tuple of FlightidError or OSError
    """

    errors: tuple[FlightidError | OSError, ...] = ()


Value = TypeVar("Value")


@dataclass
class ErrorList:
    """Errors of parts that are read one after the other, told together.

    Attributes
    ----------
    errors : list of FlightidError or OSError

    Example
    -------
    >>> def refuse(key):
    ...     raise StudyError(f"{key} is missing")
    >>> collected = ErrorList()
    >>> collected.read(refuse, None, "name"), collected.read(len, 0, "four")
    (None, 4)
    >>> collected.read(refuse, None, "path")
    >>> collected.finish()
    Traceback (most recent call last):
    flightid.study.error_list.CollectedStudyError: the study file has 2 errors:
    - name is missing
    - path is missing
    """

    errors: list[FlightidError | OSError] = field(default_factory=list)

    def read(
        self,
        work: Callable[..., Value],
        instead: Any,  # noqa: ANN401 - of the same type, or None
        *inputs: Any,  # noqa: ANN401 - whatever the part takes
    ) -> Value:
        """What a part reads, or what stands in its place while the others are read."""
        try:
            return work(*inputs)
        except CollectedStudyError as several:
            self.errors += several.errors
            return instead  # type: ignore[no-any-return]
        except (FlightidError, OSError) as error:
            self.errors.append(error)
            return instead  # type: ignore[no-any-return]

    def each(
        self,
        parts: Iterable[Part],
        read: Callable[..., Value],
        *inputs: Any,  # noqa: ANN401 - whatever the parts take
    ) -> tuple[Value, ...]:
        """What each of several parts reads; those with an error are left out."""
        made = [self.read(read, None, part, *inputs) for part in parts]
        return tuple(item for item in made if item is not None)

    def finish(self, subject: str = "study file") -> None:
        """Raise what was found: one error as it is, several as one that lists them.

        Parameters
        ----------
        subject : str
            What messages call the file.

        Raises
        ------
        FlightidError, OSError
            Of the part, where there is one.
        CollectedStudyError
            With all of them.
        """
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            # The same fault in what several parts share is told once.
            each = (str(error).removeprefix(f"{subject}, ") for error in self.errors)
            told = list(dict.fromkeys(each))
            lines = "".join(f"\n- {line}" for line in told)
            several = CollectedStudyError(f"the {subject} has {len(told)} errors:{lines}")
            several.errors = tuple(self.errors)
            raise several
