"""The report of the rig study as a content tree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import flights
import numpy as np
import tables
from vehicles import COUPLINGS, truth

from flightid.plot.fit import EstimateBar, estimates_of, fit_figure, parameter_intervals
from flightid.plot.fitted_record import record_figure
from flightid.plot.reduction import reduction_path
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Document, Figure, Lights, Paragraph, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.report.verification import verification_blocks

if TYPE_CHECKING:
    from study import Study

    import flightid as fid


def document(found: Study, subtitle: str, motor_truth: Mapping[str, float]) -> Document:
    """Put what the study found in order.

    Parameters
    ----------
    found : Study
    subtitle : str
        Form and seed.
    motor_truth : mapping of str to float
        True parameters of the rig with motors.
    """
    sections = [
        Section("The flight", _flight(found.log)),
        Section("Roll and pitch", _box(found, "roll_pitch")),
        Section("Yaw", _box(found, "yaw")),
        Section("Parameters", _parameters(found)),
        Section("Training and validation", _validation(found)),
        Section("The cross-couplings", _couplings(found)),
    ]
    if found.structures:
        sections.append(Section("A small MSE and a wrong model", _structures(found, motor_truth)))
    if found.rates:
        table = tables.rates_of_log(found.rates, truth())
        sections.append(Section("A log of 100 Hz", (TableBlock(table),)))
    sections.append(Section("The published tables", (TableBlock(tables.doubts()),)))
    return Document("Quadrotor on a rig: the published grey boxes", subtitle, tuple(sections))


def _flight(log: fid.Log) -> tuple[Block, ...]:
    words = (
        f"{log!r}. The published model flew under a rate and an attitude controller with the "
        "study's sweeps (table 2: SID_AXIS 10, 11 and 12, 0.05 to 5 Hz in 130 s, magnitudes 0.15, "
        f"0.15 and 0.55), a gyro noise of {flights.GYRO_NOISE_RAD_S} rad/s on each sample and a "
        "log of every loop. Fits see the log alone."
    )
    checks = [finding for run in log.sid_runs for finding in log.check_injection(run).findings]
    return Paragraph(words), Lights(tuple(checks), "Injection")


def _box(found: Study, name: str) -> tuple[Block, ...]:
    fit = found.found.time[name]
    place = 0
    picture = figure_block(
        record_figure(fit.records[place]),
        f"{fit.records[place].measured.name}: commands, rates as measured and as the fitted model "
        "gives them, and what is left.",
    )
    responses = [
        figure_block(
            fit_figure(found.found.frequency[name], each),
            f"{each}: instrument estimate with its 95 % band, and the model fitted to it.",
        )
        for each in found.found.frequency[name].costs
    ]
    parts = [*result_blocks(fit), TableBlock(tables.minima(fit))]
    return (*parts, TableBlock(tables.correlations(fit)), picture, *responses)


def _parameters(found: Study) -> tuple[Block, ...]:
    return (
        TableBlock(tables.parameters(found.found, truth())),
        TableBlock(tables.domains(found.found, truth())),
        figure_block(
            parameter_intervals(_estimates(found)),
            "Estimates with 95 % intervals in percent of the published value, which is the truth.",
        ),
    )


def _estimates(found: Study) -> list[EstimateBar]:
    both = [("time", found.found.time), ("frequency", found.found.frequency)]
    drawn = [
        replace(each, name=f"{each.name}, {domain}")
        for domain, fits in both
        for fit in fits.values()
        for each in estimates_of(fit, truth())
    ]
    return sorted(drawn, key=lambda each: each.name)


def _validation(found: Study) -> tuple[Block, ...]:
    table = tables.errors(found.errors, flights.GYRO_NOISE_RAD_S)
    blocks = [verification_blocks(each) for each in found.doublets.values()]
    return (TableBlock(table), *(block for each in blocks for block in each))


def _couplings(found: Study) -> tuple[Block, ...]:
    blocks: list[Block] = [
        Paragraph(_warning()),
        TableBlock(tables.couplings(found.couplings, truth())),
    ]
    if found.reduction is not None:
        out = ", ".join(step.name for step in found.reduction.path if step.accepted) or "nothing"
        words = (
            "Flights of a vehicle without couplings, fitted with the published structure: the "
            f"reduction drops {out}. A study that had looked would have known which it had."
        )
        blocks += [Paragraph(words), *result_blocks(found.reduction), _path(found.reduction)]
    return tuple(blocks)


def _path(reduction: fid.Reduction) -> Figure:
    return figure_block(reduction_path(reduction), "Cost and guides along the reduction.")


def _warning() -> str:
    value = truth()
    effect = np.array([[value["Ltphi"], value["Lttheta"]], [value["Mtphi"], value["Mttheta"]]])
    lost = abs(np.degrees(np.angle(-np.linalg.eigvals(effect)[0])))
    gain = float((effect * np.linalg.inv(effect).T)[0, 0])
    names = " and ".join(f"{name} = {value[name]:g}" for name in COUPLINGS)
    return (
        f"The published {names} are no small corrections. With equal controllers on both axes they "
        f"alone would take {lost:.0f} degrees of phase from the rate loops (the angle of the "
        f"effectiveness matrix's eigenvalues; relative gain {gain:.2f} where a symmetric frame has "
        "1). Sweeps like these would have determined them to a fraction of a percent, or shown "
        "that there are none; the study has neither interval nor test. Tune no decoupling on them."
    )


def _structures(found: Study, motor_truth: Mapping[str, float]) -> tuple[Block, ...]:
    words = (
        "The same sweeps on the nonlinear rig of flightid.simulation, which has motors with lag "
        "and delay, gusts, and no couplings. The published structure knows no motor; its "
        "training error there is below the published one, and its damping is half the truth. Its "
        "training MSE would not have told."
    )
    wrong = found.structures["published"].records[0]
    picture = figure_block(
        record_figure(wrong), "The published structure on the roll sweep of the rig with motors."
    )
    return (
        Paragraph(words),
        TableBlock(tables.structures(found.structures, motor_truth)),
        picture,
        Lights(found.structures["published"].findings, "What flightid says of that fit"),
    )
