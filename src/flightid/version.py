"""The version of flightid, as built."""

from flightid import _native

VERSION: str = _native.version()
"""Version string of both halves: reading the installed package's own loads a mail parser."""
