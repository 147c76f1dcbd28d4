"""Write docs/options.md from the fields of every options dataclass; a test keeps the page in step.

python tools/options_page.py --write
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path

from flightid import Noise
from flightid.conditioning.options import FilterOptions, OutlierOptions
from flightid.control.margins.options import (
    DiskMarginOptions,
    DisturbanceOptions,
    MarginOptions,
)
from flightid.control.tuning.controller_options import ControllerOptions
from flightid.control.tuning.options import TuneOptions
from flightid.control.tuning.requirements import TuningRequirements
from flightid.dynamics.handling_qualities.options import CutoffOptions, QualitiesOptions
from flightid.dynamics.lower_order.options import LowerOrderOptions
from flightid.dynamics.rotor.options import RotorOptions
from flightid.excitation import Limits, RateAxis
from flightid.excitation.options import DesignOptions
from flightid.export.options import FORMATS
from flightid.fleet.settings import (
    EventSettings,
    FleetQuestions,
    FleetWords,
    RunLimits,
    VehicleRules,
)
from flightid.identification.methods import METHODS
from flightid.identification.reduction.rules import ReductionLimits
from flightid.logs.options import PartOptions
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.narx.structure import NarxStructure
from flightid.models.polynomial.orders import ScanOptions
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.options import Options, options_of
from flightid.planning.options import PlanOptions
from flightid.record.options import ChannelOptions, ReadOptions
from flightid.responses.options import ResponseOptions
from flightid.simulation.fly_options import FlyOptions
from flightid.simulation.options import SimulationOptions
from flightid.study.conditioning import Conditioning, ConsistencyStep, SensorPositions
from flightid.study.fit_settings import FitMethod, VerifySettings
from flightid.study.flight import FlightPlan
from flightid.study.model_settings import ModelSettings, ParameterOverride
from flightid.study.pilot_settings import PilotSettings, RatingSettings
from flightid.study.proposal.options import ProposalOptions
from flightid.study.published import MeanSquareErrors, PublishedFigures, Remark
from flightid.study.qualities_settings import QualitiesSettings, QualityCase
from flightid.study.record_files import RecordFile
from flightid.study.reducing import ReduceSettings
from flightid.study.response_settings import ResponseSettings
from flightid.study.settings import LogChannels, LogFile, Segment, StudyWords
from flightid.study.structure_settings import StructureSettings
from flightid.study.uses_settings import ExportSettings, LoopSettings, RotorSettings
from flightid.study.view_settings import FilterSettings, PlotSettings
from flightid.validation.residuals.options import ResidualTestOptions
from flightid.validation.verification.options import VerifyOptions
from flightid.vehicles import (
    Autopilot,
    PilotDoublet,
    QuadrotorParameters,
    Sensors,
    SidActivation,
    Turbulence,
)
from flightid.vehicles.gain_flight import GainFlightOptions
from flightid.vehicles.pilot_inputs import StickOptions

PAGE = Path(__file__).parent.parent / "docs" / "options.md"
HEAD = """# Options

Every option of every method with its default and range, written from the code by
`tools/options_page.py`. The same words are arguments in Python, keys of a study file and, with
dashes, options of the command line, where some have a short form too (`--band` for
`--band-rad-s`); a value outside its range is refused with the range.
"""


STUDY: dict[str, type[Options]] = {
    "[study]": StudyWords,
    "[log]": LogFile,
    "[flight]": FlightPlan,
    "[[flight.sweep]]": SidActivation,
    "[[flight.doublet]]": PilotDoublet,
    "[flight.vehicle]": QuadrotorParameters,
    "[flight.autopilot]": Autopilot,
    "[flight.sensors]": Sensors,
    "[flight.turbulence]": Turbulence,
    "[channels]": LogChannels,
    "[[segment]]": Segment,
    "[[record]]": RecordFile,
    "[[conditioning]]": Conditioning,
    "Positions of sensors in [[conditioning]]": SensorPositions,
    "outliers of [[conditioning]]": OutlierOptions,
    "consistency of [[conditioning]]": ConsistencyStep,
    "filter of [[conditioning]]": FilterOptions,
    "[response]": ResponseSettings,
    "[fit]": FitMethod,
    "[verify]": VerifySettings,
    "[reduce], beside the limits": ReduceSettings,
    "[[model]], with equations": ModelSettings,
    "parameters of a [[model]]": ParameterOverride,
    "qualities of a [[model]]": QualityCase,
    "[[model]], structure": StructureSettings,
    "[handling_qualities]": QualitiesSettings,
    "[[export]], beside its format's": ExportSettings,
    "[rotor]": RotorSettings,
    "[[loop]]": LoopSettings,
    "[filters]": FilterSettings,
    "[[plot]]": PlotSettings,
    "[pilot]": PilotSettings,
    "rating of [pilot]": RatingSettings,
    "[plan], of a log, which tells vehicle and autopilot": PlanOptions,
}
"""Tables of a study that are no verb's alone."""

FLEET: dict[str, type[Options]] = {
    "[fleet]": FleetWords,
    "[vehicles]": VehicleRules,
    "[limits]": RunLimits,
    "[questions]": FleetQuestions,
    "[[event]]": EventSettings,
}
"""Tables of a fleet file."""


def sections() -> dict[str, type[Options]]:
    """Dataclasses by the heading that they stand under."""
    found: dict[str, type[Options]] = {"estimate_response": ResponseOptions}
    for way in METHODS:
        if options_of(way.options):
            found[f"identify, {way.name} (on {way.data})"] = way.options
    return found | {
        "Polynomial structures": PolynomialStructure,
        "Subspace structures": SubspaceStructure,
        "NARX structures": NarxStructure,
        "Orders of polynomials, and of a scan": ScanOptions,
        "predict and verify": VerifyOptions,
        "simulate": SimulationOptions,
        "Noise of a simulation": Noise,
        "simulate model, without records": StickOptions,
        "export, C": FORMATS["c"],
        "export, FMU": FORMATS["fmu"],
        "export, JSBSim": FORMATS["jsbsim"],
        "fly": FlyOptions,
        "residual_tests": ResidualTestOptions,
        "margins": MarginOptions,
        "disk_margin": DiskMarginOptions,
        "disturbance_rejection": DisturbanceOptions,
        "lower_order": LowerOrderOptions,
        "rotor_physics": RotorOptions,
        "pilot_cutoff": CutoffOptions,
        "handling_qualities": QualitiesOptions,
        "reduce": ReductionLimits,
        "tune": TuneOptions,
        "tune_controller": ControllerOptions,
        "TuningRequirements": TuningRequirements,
        "[fly] of a study, fly_gains": GainFlightOptions,
        "excitation.plan (design)": DesignOptions,
        "RateAxis: the guess of a design": RateAxis,
        "Limits of a design": Limits,
        "plan_flight (plan)": PlanOptions,
        "Reading tables": ReadOptions,
        "Part of a log or record": PartOptions,
        "Channels": ChannelOptions,
        "Studies of a log or records (run, new, tune)": ProposalOptions,
        **{f"{table} of a study": options for table, options in STUDY.items()},
        **{f"{table} of a fleet file": options for table, options in FLEET.items()},
        "A file of published figures": PublishedFigures,
        "[mean_square_error] of such a file": MeanSquareErrors,
        "[[remark]] of such a file": Remark,
    }


def section(title: str, options: type[Options]) -> str:
    """One dataclass as Markdown."""
    lines = [
        f"## {title}",
        "",
        "| option | default | value | meaning |",
        "| --- | --- | --- | --- |",
    ]
    for each in options_of(options):
        usual = "" if each.default is dataclasses.MISSING else f"`{_shown(each.default)}`"
        # A bar inside a cell would end it.
        cells = (f"`{each.name}`", usual, each.needed, each.doc)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def _shown(default: object) -> str:
    if isinstance(default, Options):
        return "as below"
    return f"{default:.6g}" if isinstance(default, float) and default % 1 else repr(default)


def page() -> str:
    """The whole page."""
    return "\n\n".join([HEAD.rstrip(), *(section(*each) for each in sections().items())]) + "\n"


def main() -> int:
    """Write the page, or say whether it is in step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the page")
    if parser.parse_args().write:
        PAGE.write_text(page(), encoding="utf-8")
        return 0
    in_step = PAGE.read_text(encoding="utf-8") == page()
    print("in step" if in_step else "out of step: run tools/options_page.py --write")
    return 0 if in_step else 1


if __name__ == "__main__":
    sys.exit(main())
