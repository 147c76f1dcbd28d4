"""Models without equations of a group of records: one of each output, or one of all together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from flightid.conventions import Light
from flightid.errors import FlightidError, StudyError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.advice.delays import delays_to_scan
from flightid.models.polynomial.orders import USED
from flightid.models.save import toml_value
from flightid.study.proposal.order_scans import Band, ProposedScans
from flightid.study.proposal.stretches import FITTED, Group, Segments, rounded
from flightid.study.structure_settings import SUBSPACE
from flightid.study.structures import RUNS_ALIKE, ranked, runs_as_well
from flightid.validation.order_scan.result import OrderTrial

KINDS = ("arx", "armax", "bj", "oe")
ORDERS = {"na": (1, 2, 3, 4), "nb": (1, 2, 3), "nc": (1, 2), "nd": (1, 2), "nf": (1, 2, 3, 4)}
"""Orders that are tried: two modes; delays are those that the record tells."""
OF_VEHICLE = ("nb", "nf", "nk")
"""Orders of Box-Jenkins that are those of the best output error, whose noise models are tried."""
CYCLES, SAMPLES_PER_CYCLE = 10.0, 10.0
"""What a response needs: cycles of its lowest frequency in a record, samples of its highest."""


@dataclass(frozen=True, eq=False)
class GroupScans:
    """A group of records that models are looked for, its parts, and the scans of its structures."""

    group: Group
    segments: Segments
    scans: ProposedScans

    @property
    def records(self) -> list[str]:
        """Lines of a model that name what is fitted and what verifies."""
        names = list(self.segments.together) or self.segments.fitted
        return [
            f"identify = {toml_value(names)}",
            f"verify = {toml_value(list(self.segments.unseen))}",
        ]

    @property
    def band(self) -> Band | None:
        """Band of a response of what is fitted, rad/s; None where it is too short for one."""
        record = self.group.parts[0].record
        span_s = record.duration_s * (1.0 if self.segments.together else FITTED)
        low = CYCLES * math.tau / span_s
        high = math.tau * record.sample_rate_hz / SAMPLES_PER_CYCLE
        return (rounded(low), rounded(high)) if high > 2 * low else None


@dataclass(frozen=True, eq=False)
class ProposedModel:
    """A model of a proposal: its lines, what is said of it, and by output what its runs reached."""

    name: str
    lines: list[str]
    said: tuple[str, ...] = ()
    error: float = 0.0
    settle_s: float = 0.0
    tried: str = ""


def structures_of(asked: GroupScans) -> tuple[list[ProposedModel], list[Finding]]:
    """Models of a group, and why outputs have none.

    Parameters
    ----------
    asked : GroupScans

    Returns
    -------
    tuple of list
        One model of each output, or one of all outputs where that runs freely better.
    """
    alone: dict[str, ProposedModel] = {}
    missed: list[Finding] = []
    for output in asked.scans.outputs:
        name = f"{output} from {' and '.join(asked.group.inputs)}"
        try:
            alone[output] = _polynomial(name, output, asked)
        except FlightidError as error:
            why = str(error).partition(". Next: ")[0]
            said = f"{name}: no model, {why}"
            missed.append(Finding("no-model", Light.RED, said, error.action or ""))
    found = [*alone.values()]
    return (found if missed or len(alone) < 2 else _or_together(found, tuple(alone), asked)), missed


def _lines(
    name: str, said: str, kind: str, outputs: str | list[str], asked: GroupScans
) -> list[str]:
    return [
        "", "[[model]]", f"name = {toml_value(name)}",
        f"tried = {toml_value(f'{said}.')}",
        f"structure = {toml_value(kind)}",
        f"inputs = {toml_value(list(asked.group.inputs))}", f"outputs = {toml_value(outputs)}",
        *asked.records,
    ]  # fmt: skip


def _coherent(asked: GroupScans) -> list[str]:
    """The band in which coherence tells what drives."""
    return [] if asked.band is None else [f"band_rad_s = {toml_value(list(asked.band))}"]


def _polynomial(name: str, output: str, asked: GroupScans) -> ProposedModel:
    """The structure of one output that runs freely with the least error."""
    driving = asked.scans.driving((output,), asked.band)
    unit = asked.group.parts[0].record.unit(output)
    kind, errors, best, settle_s, orders_of = _structure(asked.scans, output, driving)
    said = ", ".join(f"{each} {errors[each]:.3g}" for each in KINDS if each in errors)
    said = f"Error of free runs on what was not fitted, by kind: {said} {unit}".rstrip()
    orders = [f"{order} = {toml_value(list(orders_of[order]))}" for order in USED[kind]]
    head = _lines(name, said, kind, output, asked)
    choice = f"select = {toml_value(asked.segments.choice)}"
    lines = [*head, choice, *_coherent(asked), *orders]
    return ProposedModel(name, lines, error=best, settle_s=settle_s, tried=f"{said}.")


def _structure(
    scans: ProposedScans, output: str, inputs: tuple[str, ...]
) -> tuple[str, dict[str, float], float, float, dict[str, tuple[int, ...]]]:
    """The kind that is taken, errors of all and its own, stretch without a score, s, and orders."""
    flown = scans.flown(output, inputs)
    orders = ORDERS | {"nk": delays_to_scan([flown], inputs, output)}
    of_kind = dict.fromkeys(KINDS, orders)
    reached: dict[str, OrderTrial] = {}
    settle_s = 0.0
    for kind in sorted(KINDS, key=("arx", "armax", "oe", "bj").index):
        tried = {order: of_kind[kind][order] for order in USED[kind]}
        scan = scans.scan(kind, output, tried, inputs)
        settle_s = max(settle_s, scan.settle_s)
        if scan.trials[0].free_run_rms is not None:
            reached[kind] = scan.trials[0]
        if kind == "oe":
            taken = ranked(scan, "balanced")[0].structure
            of_kind["bj"] = orders | {name: getattr(taken, name)[:1] for name in OF_VEHICLE}
    if not reached:
        raise StudyError("no structure runs freely", needed="a record that moves the output")
    errors = {kind: best.free_run_rms or 0.0 for kind, best in reached.items()}
    least = reached[min(errors, key=lambda kind: errors[kind])]
    # What comes last assumes least of the noise, so that its intervals hold for more of it.
    good = [kind for kind in KINDS if kind in reached and runs_as_well(reached[kind], least)]
    return good[-1], errors, errors[good[-1]], settle_s, of_kind[good[-1]]


def _or_together(
    alone: list[ProposedModel], outputs: tuple[str, ...], asked: GroupScans
) -> list[ProposedModel]:
    """One subspace model of all outputs in their place where it runs better; both are said."""
    try:
        driving = asked.scans.driving(outputs, asked.band)
        settle_s = max(each.settle_s for each in alone)
        together = asked.scans.subspace_errors(outputs, driving, settle_s)
    except FlightidError:
        return alone
    if together is None:
        return alone
    errors = dict(zip(outputs, (each.error for each in alone), strict=True))
    reached = ", ".join(
        f"{name} {together[name]:.3g} (by itself {error:.3g})" for name, error in errors.items()
    )
    what = f"one model of all outputs: free runs on what was not fitted err by {reached}"
    if not runs_better([together[name] for name in outputs], [*errors.values()]):
        left = f"Not taken, {what}"
        return [replace(_told(alone[0], left), said=(left,)), *(_told(x, left) for x in alone[1:])]
    name = f"{' and '.join(outputs)} from {' and '.join(asked.group.inputs)}"
    said = f"Taken, {what}"
    lines = [*_lines(name, said, SUBSPACE, [*outputs], asked), *_coherent(asked)]
    return [ProposedModel(name, lines, (said,))]


def _told(model: ProposedModel, left: str) -> ProposedModel:
    """A model with what was left for it, where its report repeats it."""
    tried = f"{model.tried} {left}."
    lines = [f"tried = {toml_value(tried)}" if x.startswith("tried = ") else x for x in model.lines]
    return replace(model, lines=lines, tried=tried)


def runs_better(together: Sequence[float], alone: Sequence[float]) -> bool:
    """Whether free runs of a joint model are worse at no output, and better on the whole.

    What `RUNS_ALIKE` calls alike is neither: models of one output, whose intervals hold in noise
    of any colour, are left where the other is clearly better alone.

    Parameters
    ----------
    together, alone : sequence of float
        Errors by output, in the output's unit.

    Example
    -------
    >>> runs_better([0.8, 1.0], [1.0, 1.0]), runs_better([0.2, 1.1], [1.0, 1.0])
    (True, False)
    """
    pairs = zip(together, alone, strict=True)
    ratios = [one / other if other > 0.0 else math.inf for one, other in pairs]
    if max(ratios) > 1.0 + RUNS_ALIKE:
        return False
    return math.prod(ratios) ** (1.0 / len(ratios)) < 1.0 / (1.0 + RUNS_ALIKE)
