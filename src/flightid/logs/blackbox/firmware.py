"""Which firmware wrote a blackbox, by the line of its header that says so."""

from __future__ import annotations

import re

from flightid.frozen import dataclass

BETAFLIGHT, INAV = "betaflight", "inav"
BLACKBOX = (BETAFLIGHT, INAV)
"""Kinds of logs that are blackboxes: INAV has its own, all its relatives Betaflight's."""
REVISION = "Firmware revision"
_REVISION = re.compile(
    r"(?P<name>Betaflight|INAV)\D{0,3}(?P<major>\d{1,4})\.(?P<minor>\d{1,3})", re.IGNORECASE
)


@dataclass(frozen=True)
class Firmware:
    """Who wrote a blackbox.

    Attributes
    ----------
    name : str
        ``"betaflight"``, ``"inav"``, or empty: another, or not told.
    version : tuple of int
        Major and minor number; zeros where it is another.
    """

    name: str = ""
    version: tuple[int, int] = (0, 0)

    @property
    def is_inav(self) -> bool:
        """Whether it is INAV."""
        return self.name == INAV


def firmware_of(revision: str) -> Firmware:
    """Firmware and version by the text of a header.

    Parameters
    ----------
    revision : str
        The line "Firmware revision".

    Example
    -------
    >>> firmware_of("INAV 7.1.2 (4e1e59eb) MATEKF722")
    Firmware(name='inav', version=(7, 1))
    >>> firmware_of("EmuFlight 0.4.1")
    Firmware(name='', version=(0, 0))
    """
    found = _REVISION.search(revision)
    if found is None:
        return Firmware()
    return Firmware(found["name"].lower(), (int(found["major"]), int(found["minor"])))
