"""A channel: the name, unit and role under which samples are known."""

from __future__ import annotations

from dataclasses import replace

from flightid.conventions import Role
from flightid.frozen import dataclass
from flightid.units import canonical

DECLARED = "unit declared as"
"""In the note of a channel whose unit was declared against its heading."""


@dataclass(frozen=True)
class Channel:
    """Label of one signal of a record.

    Attributes
    ----------
    name : str
        Name, for example ``"p"``.
    unit : str
        Canonical unit, for example ``"rad/s"``.
    role : Role
        What the signal is to the system.
    note : str
        Where it came from, for example ``"RATE.R, deg/s in the log"``.

    Example
    -------
    >>> Channel("p", "radian/second", Role.OUTPUT)
    Channel(name='p', unit='rad/s', role=<Role.OUTPUT: 'output'>, note='')
    """

    name: str
    unit: str
    role: Role = Role.OTHER
    note: str = ""

    @property
    def is_declared(self) -> bool:
        """Whether the unit was declared against what the file says; the note tells both."""
        return DECLARED in self.note

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", canonical(self.unit))
        object.__setattr__(self, "role", Role(self.role))

    def with_role(self, role: Role) -> Channel:
        """Copy with another role."""
        return replace(self, role=role)
