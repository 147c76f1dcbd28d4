"""A study file written for data that have none: what is identified, from what, and why so."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flightid.study.proposal.proposal import Proposal
    from flightid.study.proposal.propose import propose_study

_HOMES = {
    "Proposal": "flightid.study.proposal.proposal",
    "propose_study": "flightid.study.proposal.propose",
}

__all__ = ["Proposal", "propose_study"]


# The options of commands lie here too: their help shall not load all that a run needs.
def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'flightid.study.proposal' has no attribute {name!r}")
    value: object = getattr(import_module(home), name)
    globals()[name] = value
    return value
