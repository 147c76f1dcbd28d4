"""Libraries that only some need: loaded where they are called, installed by an extra."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from flightid.errors import OptionError

EXTRAS = {"pandas": "tables", "pyarrow": "parquet", "xarray": "tables"}
EXTRAS |= dict.fromkeys(("lz4", "rosbags", "zstandard"), "ros")
EXTRAS |= dict.fromkeys(("dask", "distributed", "duckdb", "fsspec"), "fleet")
EXTRAS |= dict.fromkeys(("fastapi", "pebble", "tomlkit", "uvicorn", "websockets"), "app")
"""Extra of the package that installs a library."""


def extra_module(name: str, purpose: str) -> Any:  # noqa: ANN401 - a module
    """Module of a library that an extra installs.

    Parameters
    ----------
    name : str
        Of the module, such as "pyarrow.parquet".
    purpose : str
        What needs it, for the error: "a Parquet file".

    Raises
    ------
    OptionError
        It is not installed; the message names the extra.
    """
    library = name.partition(".")[0]
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        raise OptionError(
            f"{purpose} needs {library}, which is not installed",
            found=f"no module {error.name}",
            needed=f"the extra {EXTRAS[library]!r} of flightid",
            action=f"pip install 'flightid[{EXTRAS[library]}]'",
        ) from error
