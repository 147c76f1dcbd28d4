"""Fleets: thousands of logs through one study, and one catalogue of what came of them."""

from flightid.fleet.catalogue.catalogue import Catalogue
from flightid.fleet.opening import open_catalogue as open
from flightid.fleet.proposal import FleetProposal, propose_fleet
from flightid.fleet.reporting import ask_fleet, fleet_report
from flightid.fleet.run import FleetRun, run_fleet
from flightid.fleet.settings import FleetSettings, read_fleet
from flightid.fleet.status import FleetStatus, fleet_status
from flightid.fleet.type_models import type_models

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


def __dir__() -> list[str]:
    return sorted(__all__)
