"""Control: loops around identified models, their margins, and gains with margins over doubt."""

from flightid.control import loops

__all__ = ["loops"]
