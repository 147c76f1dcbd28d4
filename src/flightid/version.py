"""The version of flightid, as installed."""

from importlib.metadata import version

VERSION: str = version("flightid")
"""Version string of the installed package."""
