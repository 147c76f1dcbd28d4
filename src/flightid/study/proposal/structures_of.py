"""Models without equations of a group of records: one of each output, or one of all together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from flightid.conventions import Light
from flightid.errors import FlightidError, StudyError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.identification.advice.delays import delays_to_scan
from flightid.models import SubspaceStructure
from flightid.models.polynomial.orders import USED
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.save import toml_value
from flightid.study.proposal.nonlinear import NonlinearChoice, nonlinear_choice
from flightid.study.proposal.order_scans import Band, ProposedScans
from flightid.study.proposal.stretches import FITTED, Group, Segments, rounded
from flightid.study.structure_settings import NARX, SUBSPACE
from flightid.study.structures import RUNS_ALIKE, ranked, runs_as_well
from flightid.units import DIMENSIONLESS
from flightid.validation import OrderScan
from flightid.validation.order_scan.result import OrderTrial, rank_of

POLYNOMIALS = ("arx", "armax", "bj", "oe")
KINDS = ("arx", "armax", SUBSPACE, "bj", "oe")
"""Those that assume most of the noise first; of several inputs with a model of states too."""
ORDERS = {"na": (1, 2, 3, 4), "nb": (1, 2, 3), "nc": (1, 2), "nd": (1, 2), "nf": (1, 2, 3, 4)}
"""Orders that are tried: two modes; delays are those that the record tells."""
OF_VEHICLE = ("nb", "nf", "nk")
"""Orders of Box-Jenkins that are those of the best output error, whose noise models are tried."""
REFUTED = 50.0
"""By how much BIC rules a delay out: far more than the colour of errors makes of it."""
FOR_GAINS = (
    "Beside a NARX model that runs better: for margins and gains at the levels of the record"
)
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
        verify = f"verify = {toml_value(list(self.segments.unseen))}"
        if not self.segments.unseen:
            verify = (
                "# Nothing stays unseen: fly sweeps or doublets again, name that record for verify."
            )
        return [f"identify = {toml_value(names)}", verify]

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
    """A model of a proposal: its lines, what is said of it, and what its runs reached.

    `beside` is the linear model of a nonlinear one, which gains can rest on.
    """

    name: str
    lines: list[str]
    said: tuple[str, ...] = ()
    error: float = 0.0
    settle_s: float = 0.0
    tried: str = ""
    beside: tuple[ProposedModel, ...] = ()


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
            alone[output] = _alone(name, output, asked)
        except FlightidError as error:
            why = str(error).partition(". Next: ")[0]
            said = f"{name}: no model, {why}"
            missed.append(Finding("no-model", Light.RED, said, error.action or ""))
    found = [*alone.values()]
    if not missed and len(alone) > 1:
        found = _or_together(found, tuple(alone), asked)
    return [each for model in found for each in (model, *model.beside)], missed


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


def _alone(name: str, output: str, asked: GroupScans) -> ProposedModel:
    """The structure of one output that runs freely with the least error."""
    driving = asked.scans.driving((output,), asked.band)
    unit = asked.group.parts[0].record.unit(output)
    best = _linear(asked.scans, output, driving)
    curved = best.nonlinear(asked.scans)
    said = ", ".join(f"{kind} {error:.3g}" for kind, error in best.errors.items())
    said = f"Error of free runs on what was not fitted, by kind: {said}"
    said += f" {unit}" if unit and unit != DIMENSIONLESS else ""
    told = () if curved is None else (curved.said,)
    tried = ". ".join((said, *told))
    # Named where one structure alone is left, too: records are read with what all models ask.
    choice = f"select = {toml_value(asked.segments.choice)}"

    def linear(name: str, tried: str, told: tuple[str, ...] = ()) -> ProposedModel:
        head = _lines(name, tried, best.kind, output, asked)
        lines = [*head, choice, *_coherent(asked), *best.lines]
        error = best.errors[best.kind]
        return ProposedModel(name, lines, told, error, best.settle_s, f"{tried}.")

    if curved is None or not curved.is_better:
        return linear(name, tried, told)
    # What is not linear takes coherence away, and says nothing against the input.
    given = replace(asked, group=replace(asked.group, inputs=driving))
    lines = [*_lines(name, tried, NARX, output, given), choice, *curved.lines]
    beside = () if best.is_red else (linear(f"{name}, linear", f"{said}. {FOR_GAINS}"),)
    return ProposedModel(name, lines, told, curved.error, best.settle_s, f"{tried}.", beside)


@dataclass(frozen=True, eq=False)
class _Linear:
    """Linear models of an output: the best trial of each kind, and the kind that is taken."""

    kind: str
    reached: dict[str, OrderTrial]
    fits: dict[str, Fit]
    orders: dict[str, dict[str, tuple[int, ...]]]
    settle_s: float

    @property
    def errors(self) -> dict[str, float]:
        """Of free runs by kind, in the output's unit."""
        return {
            kind: self.reached[kind].free_run_rms or 0.0 for kind in KINDS if kind in self.reached
        }

    @property
    def is_red(self) -> bool:
        """Whether the kind that is taken is not to be used by itself."""
        return self.fits[self.kind].evidence.light is Light.RED

    @property
    def lines(self) -> list[str]:
        """Keys of the kind that is taken: orders to try, or the one that ran best."""
        structure = self.reached[self.kind].structure
        if isinstance(structure, SubspaceStructure):
            return [f"order = {structure.order}"]
        orders = self.orders[self.kind]
        return [f"{order} = {toml_value(list(orders[order]))}" for order in USED[self.kind]]

    def nonlinear(self, scans: ProposedScans) -> NonlinearChoice | None:
        """NARX models beside the linear one, where its residuals ask for them."""
        least = min(self.reached.values(), key=rank_of)
        delay = min(self.orders["arx"]["nk"])
        return nonlinear_choice(scans, self.fits[self.kind], least, delay, self.settle_s)


def _linear(scans: ProposedScans, output: str, inputs: tuple[str, ...]) -> _Linear:
    """The kind whose best structure errs least in free run."""
    flown = scans.flown(output, inputs)
    orders = ORDERS | {"nk": delays_to_scan([flown], inputs, output)}
    of_kind = {}
    scanned: dict[str, OrderScan] = {}
    for kind in sorted(POLYNOMIALS, key=("arx", "armax", "oe", "bj").index):
        tried = of_kind[kind] = {order: orders[order] for order in USED[kind]}
        scanned[kind] = scans.scan(kind, output, tried, inputs)
        if kind == "armax" and len(inputs) > 1:
            orders = orders | {"nk": likely_delays(scanned[kind])}
        if kind == "oe":
            taken = ranked(scanned[kind], "balanced")[0].structure
            orders = orders | {name: getattr(taken, name)[:1] for name in OF_VEHICLE}
    settle_s = max(scan.settle_s for scan in scanned.values())
    firsts = {kind: scan.trials[0] for kind, scan in scanned.items()}
    fits = {kind: scan.best for kind, scan in scanned.items()}
    states = scans.subspace(output, inputs, settle_s) if len(inputs) > 1 else None
    if states is not None and states.fit is not None:
        firsts[SUBSPACE], fits[SUBSPACE] = states, states.fit
    reached = {kind: first for kind, first in firsts.items() if first.free_run_rms is not None}
    if not reached:
        raise StudyError("no structure runs freely", needed="a record that moves the output")
    return _Linear(_taken(reached), reached, fits, of_kind, settle_s)


def _taken(reached: Mapping[str, OrderTrial]) -> str:
    """The kind that assumes least of the noise, of those that run as well as the best.

    A model of states stands for it where its errors are far likelier: free runs over a plant that
    drifts are few, and take what fits the noise badly by chance.
    """
    least = min(reached.values(), key=lambda each: each.free_run_rms or 0.0)
    good = [kind for kind in KINDS if kind in reached and runs_as_well(reached[kind], least)]
    if SUBSPACE in good and _bic(reached[SUBSPACE]) < _bic(reached[good[-1]]) - REFUTED:
        return SUBSPACE
    return good[-1]


def _bic(trial: OrderTrial) -> float:
    known = None if trial.likelihood is None else trial.likelihood.bic
    return math.inf if known is None else known


def likely_delays(scan: OrderScan) -> tuple[int, ...]:
    """Delays that the likelihood of some order of a scan leaves in play.

    With several inputs output error takes most of the time; with a delay that even the best orders
    and a model of the noise fit far worse, it finds what fits by chance.

    Parameters
    ----------
    scan : OrderScan
        Of a kind with a model of the noise.
    """
    least: dict[int, float] = {}
    for trial in scan.trials:
        if isinstance(trial.structure, PolynomialStructure):
            delay = min(trial.structure.nk)
            least[delay] = min(_bic(trial), least.get(delay, math.inf))
    most = min(least.values()) + REFUTED
    return tuple(sorted(delay for delay, bic in least.items() if bic <= most))


def _or_together(
    alone: list[ProposedModel], outputs: tuple[str, ...], asked: GroupScans
) -> list[ProposedModel]:
    """One subspace model of all outputs in their place where it runs better; both are said."""
    try:
        driving = asked.scans.driving(outputs, asked.band)
        settle_s = max(each.settle_s for each in alone)
        errors = dict(zip(outputs, (each.error for each in alone), strict=True))
        together = asked.scans.subspace_errors(outputs, driving, settle_s, errors)
    except FlightidError:
        return alone
    if together is None:
        return alone
    reached = ", ".join(
        f"{name} {together[name]:.3g} (by itself {error:.3g})" for name, error in errors.items()
    )
    what = f"one model of all outputs: free runs on what was not fitted err by {reached}"
    if not runs_better([together[name] for name in outputs], [*errors.values()]):
        left = f"Not taken, {what}"
        first = replace(_told(alone[0], left), said=(*alone[0].said, left))
        return [first, *(_told(each, left) for each in alone[1:])]
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
