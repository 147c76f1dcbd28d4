"""Studies: the only place that chains stages, from a study file to a report."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flightid.study.run import run_study
    from flightid.study.settings import Settings
    from flightid.study.study import Study

_HOMES = {
    "Settings": "flightid.study.settings",
    "Study": "flightid.study.study",
    "run_study": "flightid.study.run",
}

__all__ = ["Settings", "Study", "run_study"]


# The options of commands lie here too: their help shall not load all that a run needs.
def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'flightid.study' has no attribute {name!r}")
    value: object = getattr(import_module(home), name)
    globals()[name] = value
    return value
