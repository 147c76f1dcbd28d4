"""Fleets: thousands of logs through one study, and one catalogue of what came of them."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flightid.fleet.catalogue.catalogue import Catalogue
    from flightid.fleet.opening import open_catalogue as open
    from flightid.fleet.pooled_models import type_models
    from flightid.fleet.proposal import FleetProposal, propose_fleet
    from flightid.fleet.reporting import ask_fleet, fleet_report
    from flightid.fleet.run import run_fleet
    from flightid.fleet.run_result import FleetRun
    from flightid.fleet.settings import FleetSettings, read_fleet
    from flightid.fleet.status import FleetStatus, fleet_status

_HOMES = {
    "Catalogue": ("flightid.fleet.catalogue.catalogue", "Catalogue"),
    "FleetProposal": ("flightid.fleet.proposal", "FleetProposal"),
    "FleetRun": ("flightid.fleet.run_result", "FleetRun"),
    "FleetSettings": ("flightid.fleet.settings", "FleetSettings"),
    "FleetStatus": ("flightid.fleet.status", "FleetStatus"),
    "ask_fleet": ("flightid.fleet.reporting", "ask_fleet"),
    "fleet_report": ("flightid.fleet.reporting", "fleet_report"),
    "fleet_status": ("flightid.fleet.status", "fleet_status"),
    "open": ("flightid.fleet.opening", "open_catalogue"),
    "propose_fleet": ("flightid.fleet.proposal", "propose_fleet"),
    "read_fleet": ("flightid.fleet.settings", "read_fleet"),
    "run_fleet": ("flightid.fleet.run", "run_fleet"),
    "type_models": ("flightid.fleet.pooled_models", "type_models"),
}

__all__ = [
    "Catalogue",
    "FleetProposal",
    "FleetRun",
    "FleetSettings",
    "FleetStatus",
    "ask_fleet",
    "fleet_report",
    "fleet_status",
    "open",
    "propose_fleet",
    "read_fleet",
    "run_fleet",
    "type_models",
]


# `flightid tune` asks of each path whether it is a fleet: it shall not load all that fleets need.
def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'flightid.fleet' has no attribute {name!r}")
    home, own = _HOMES[name]
    value: object = getattr(import_module(home), own)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
