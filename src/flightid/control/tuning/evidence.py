"""What the data allow gains to rest on: the plants that may be, the band, and what forbids it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.control.tuning.size_findings import answers_by_size
from flightid.control.tuning.structure_error import Band, errors_of, identified_band, no_band
from flightid.conventions import Light
from flightid.dynamics.continuous import to_continuous
from flightid.errors import DataError, FlightidError
from flightid.evidence.evidence import BAND, LOOP, SWEEP
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.fit import WITHHOLDING, Fit
from flightid.identification.instrument_fit import instrument_fit
from flightid.identification.model_error import ModelErrorBound
from flightid.identification.prediction_error.findings import CANCELLATION
from flightid.identification.simpler_structure import simpler_fit
from flightid.identification.uncertain_of import evidence_behind, uncertain_of
from flightid.inspection.thresholds import BAND_LEAST
from flightid.inspection.usable_band import NARROW
from flightid.models import InnovationsModel, NarxModel, PolynomialModel
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.model import linear_system, model_of
from flightid.responses.pair import PairResponse
from flightid.uncertainty.uncertain import Uncertain

CORNER = 2.0
"""Standard deviations from the estimate to the corners that a search begins with."""
UNEXPLAINED_PERCENT = 20.0
"""Of an output's variance: beyond it no gains, whatever the residuals are."""
SAME_STEP = 1e-6
"""Relative difference of equal steps."""
SIMPLER = "simpler-structure"
"""Code of gains for a simpler structure than the one that was asked for."""
BY_INSTRUMENT = "instrument-fit"
"""Code of gains for a fit by way of the excitation in place of one that a loop biases."""
TAKING = (*WITHHOLDING, CANCELLATION)
"""Codes of findings that took a covariance, and say what gives it back."""
MISSES = "the model misses"
"""How a reason begins that a fit of a response has no errors for what its structure lacks."""
LACKING = (
    "add the dynamics that the model lacks (motor lag, delay, a mode), or fit the band alone in "
    "which it follows the response"
)
Array = NDArray[np.float64]


class Verdicts(Protocol):
    """A verification, as far as tuning asks."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdicts on the prediction of records that the fit has not seen."""
        ...


@dataclass(frozen=True, eq=False)
class TuningEvidence:
    """What gains may rest on.

    Attributes
    ----------
    estimate : LinearSystem
    corners, draws : tuple of LinearSystem
        Two standard deviations along each independent direction, and random ones for the search.
    fresh : tuple of LinearSystem
        Draws that the search does not see.
    band_rad_s : tuple of float or None
        Identified band, rad/s.
    hold_in_model : bool
        Whether the model's delay holds the output hold's half sample.
    findings : tuple of Finding
    measured : mapping of str to PairResponse
        The fitted responses by ``"output/input"``.
    errors : mapping of str to ModelErrorBound
        By ``"output/input"``: how far the model itself was from its data.
    left_out : int
        Fresh plants drawn that no gains could hold beside the others.
    rigid : bool
        Whether the vehicle was declared to have no light mode outside the band.
    """

    estimate: LinearSystem
    corners: tuple[LinearSystem, ...]
    draws: tuple[LinearSystem, ...]
    fresh: tuple[LinearSystem, ...]
    band_rad_s: Band | None
    hold_in_model: bool
    findings: tuple[Finding, ...]
    measured: Mapping[str, PairResponse] = field(default_factory=dict)
    errors: Mapping[str, ModelErrorBound] = field(default_factory=dict)
    left_out: int = 0
    rigid: bool = False

    @property
    def sources(self) -> tuple[LinearSystem, ...]:
        """Estimate, corners and draws."""
        return (self.estimate, *self.corners, *self.draws)


def gather(
    source: object,
    sample_time_s: float,
    pairs: Sequence[str],
    *,
    draws: int,
    fresh: int,
    seed: int,
    band_rad_s: Band | None,
    verification: Verdicts | Iterable[Verdicts] | None,
    nominal: bool,
    accept_red: bool,
    needs_band: bool,
    rigid: bool = False,
) -> TuningEvidence:
    """Collect plants, or refuse where the data cannot carry gains.

    Parameters
    ----------
    source : fit or model
    sample_time_s : float
        Of the autopilot's loop, s.
    pairs : sequence of str
        ``"output/input"`` of the axes.
    draws, fresh : int
        Draws for the search, and others to judge its result by.
    seed : int
    band_rad_s : tuple of float or None
        Identified band, rad/s; where the data show one, what both have in common.
    verification : Verification or several, optional
        Predictions of records that the fit has not seen.
    nominal : bool
        Go on without a covariance.
    accept_red : bool
        Go on where the data refuse gains; every refusal is then a red finding.
    needs_band : bool
        Whether the crossover is bounded by the band.
    rigid : bool
        Declare that nothing on the vehicle swings or bends outside the band.

    Raises
    ------
    DataError
        No linear model, no covariance, no identified band, a fit or a verification that is red,
        too much that the model does not explain.
    """
    _require_linear(source)
    source, choice = (source, ()) if nominal else _with_errors(source)
    uncertain: Uncertain[Any] = uncertain_of(source)
    errors = errors_of(source)
    band = identified_band(source, errors, pairs, band_rad_s)
    refusals = [*_refusals(source, uncertain, pairs, verification, nominal=nominal)]
    if band is None and needs_band:
        refusals.append(no_band(errors, pairs))
    findings = [_accepted(each, accept_red=accept_red) for each in refusals]
    findings += [*choice, *_judged(source), *answers_by_size(source, pairs, band)]
    if not uncertain.known and nominal:
        findings.append(
            Finding(
                "no-uncertainty",
                Light.AMBER,
                f"margins are those of the model alone: {uncertain.reason}",
                "identify the vehicle, and keep more margin until then",
            )
        )
    plants = [_linear(each, sample_time_s) for each in uncertain.draws(draws + fresh, seed)]
    return TuningEvidence(
        _linear(uncertain.value, sample_time_s),
        tuple(_corners(uncertain, sample_time_s)),
        tuple(plants[:draws]),
        tuple(plants[draws:]),
        band,
        hold_in_model(source),
        tuple(findings),
        {
            each.name: each.measured
            for each in getattr(source, "responses", ())
            if hasattr(each, "measured")
        },
        errors,
        rigid=rigid,
    )


def _require_linear(source: object) -> None:
    """Margins of a linearisation hold where it was taken, and nobody knows its errors there."""
    model = model_of(source)
    if isinstance(model, NarxModel):
        raise DataError(
            "a nonlinear model has other margins at every level, so no gains are made from it",
            found=f"a NARX model of {model.output}, whose weights have no standard errors",
            needed="a linear model of one operating point",
            action="record steps about that point, so small that a linear model's residuals pass, "
            "and tune by that record",
        )


def _with_errors(source: object) -> tuple[object, tuple[Finding, ...]]:
    """The source, or what stands in for a fit without errors or one that a loop biases."""
    if not isinstance(source, Fit):
        return source, ()
    if (simpler := simpler_fit(source)) is not None:
        action = "identify with these orders, so that the model of the gains is the one you keep"
        text = f"gains rest on {simpler.reason}"
        return simpler.fit, (Finding(SIMPLER, Light.AMBER, text, action),)
    if (other := instrument_fit(source)) is not None:
        action = "fit the response by estimator='instrument', so that the model of the gains is "
        text = f"gains rest on {other.reason}"
        return other.fit, (Finding(BY_INSTRUMENT, Light.AMBER, text, f"{action}the one you keep"),)
    return source, ()


def _accepted(refusal: DataError, *, accept_red: bool) -> Finding:
    """A refusal as a red finding, where the user goes on in spite of it."""
    if not accept_red:
        raise refusal
    text = f"accepted by the user: {refusal.problem}: found {refusal.found}"
    return Finding("accepted-red", Light.RED, text, str(refusal.action or ""))


def _refusals(
    source: object,
    uncertain: Uncertain[Any],
    pairs: Sequence[str],
    verification: Verdicts | Iterable[Verdicts] | None,
    *,
    nominal: bool,
) -> Iterator[DataError]:
    """What forbids gains, the worst first."""
    examined = evidence_behind(source)
    if examined is not None and examined.verdict.light is Light.RED:
        yield _red(f"the fit of {' and '.join(pairs)}", examined.verdict)
    else:
        yield from _first_red("the fit", source)
        seen = None if examined is None else examined.check(BAND)
        if seen is not None and seen.what.endswith(NARROW):
            # Dynamics beside such a band are the form's word: a mode there took the margins away.
            yield DataError(
                "the model was seen in too narrow a band for gains",
                found=seen.what,
                needed=f"{BAND_LEAST.value:g} to 1 at least",
                action=seen.action,
            )
        swept = None if examined is None else examined.check(SWEEP)
        if swept is not None:
            yield DataError(
                "the log of this model carries no gains",
                found=swept.what.partition(":")[0],
                needed="a sweep or an injection about each axis",
                action=swept.action,
            )
        loop = None if examined is None else examined.check(LOOP)
        if loop is not None and loop.light is Light.UNKNOWN:
            yield DataError(
                "whether a loop was closed is not known, so no gains are made from the fit",
                found=loop.what,
                needed="a declared loop",
                action=loop.action,
            )
    for each in _listed(verification):
        yield from _first_red("the verification", each)
    left = [
        f"{name} {cost:.3g} %"
        for name, cost in getattr(source, "costs", {}).items()
        if cost > UNEXPLAINED_PERCENT and not getattr(source, "responses", ())
    ]
    if left:
        yield DataError(
            "too much of the data is left unexplained for gains",
            found=f"share of variance in the residuals: {', '.join(left)}",
            needed=f"at most {UNEXPLAINED_PERCENT:g} %",
            action="add the dynamics that the model lacks (motor lag, delay), or fit the response "
            "to the injected excitation, which noise does not enter",
        )
    if not uncertain.known and not nominal:
        yield DataError(
            "gains for a model whose errors are not known would promise nothing",
            found=uncertain.reason,
            needed="a fit with a covariance",
            action=_towards_errors(source, uncertain.reason),
        )


def _towards_errors(source: object, reason: str) -> str:
    """What gives a fit its covariance: what the finding that took it says, where one did."""
    for finding in getattr(source, "findings", ()):
        took = finding.code in TAKING or finding.message.startswith(reason)
        if took and finding.action:
            return str(finding.action)
    if reason.startswith(MISSES):
        return LACKING
    return "fit a measured response or records; or take nominal=True and keep margins"


def _listed(given: Verdicts | Iterable[Verdicts] | None) -> Sequence[Verdicts]:
    if given is None:
        return ()
    return tuple(given) if isinstance(given, Iterable) else (given,)


def _judged(source: object) -> tuple[Finding, ...]:
    """The light of a fit's evidence: amber goes on with its gains."""
    examined, pooled = evidence_behind(source), _pooled(source)
    if examined is None or examined.verdict.light in (Light.GREEN, Light.RED):
        return pooled
    verdict = examined.verdict
    text = f"gains rest on a fit that is {verdict.light}: {verdict.message}"
    return (Finding("fit-evidence", verdict.light, text, verdict.action), *pooled)


def _pooled(source: object) -> tuple[Finding, ...]:
    """That vehicles of a pooled type changed, or are unlike the others."""
    known = getattr(source, "estimated", None)
    apart = [] if known is None else list(known.provenance.get("apart", ()))
    if not apart:
        return ()
    said = f"pooled with the others though apart from them: {'; '.join(apart)}"
    action = (
        "look at what was done to them; a type of their own in the table of [vehicles] keeps them "
        "out of the others' gains"
    )
    return (Finding("pooled-apart", Light.AMBER, said, action),)


def _first_red(what: str, result: object) -> Iterator[DataError]:
    for finding in getattr(result, "findings", ()):
        if finding.light is Light.RED:
            yield _red(what, finding)
            return


def _red(what: str, finding: Finding) -> DataError:
    return DataError(
        f"{what} is red, so no gains are made from it: {finding.message}",
        needed="a model that its data support",
        action=finding.action or None,
    )


def hold_in_model(source: object) -> bool:
    """A fit that was told of held inputs keeps the half sample out of its delay."""
    provenance = getattr(getattr(source, "estimated", source), "provenance", {})
    options = provenance.get("options", provenance) if isinstance(provenance, Mapping) else {}
    hold = options.get("hold", provenance.get("hold")) if isinstance(options, Mapping) else None
    return hold != "zero"


def _linear(source: object, sample_time_s: float) -> LinearSystem:
    """Continuous system, or a recursion at the loop's own samples."""
    model = model_of(source)
    if isinstance(model, PolynomialModel | InnovationsModel):
        if abs(model.sample_time_s / sample_time_s - 1.0) > SAME_STEP:
            return to_continuous(model)
        return linear_system(model)
    return linear_system(source)


def _corners(uncertain: Uncertain[Any], sample_time_s: float) -> Iterable[LinearSystem]:
    """Corners that make sense; one that does not (a negative delay) is left out."""
    for pair in _pairs(uncertain):
        for each in pair:
            try:
                yield _linear(each, sample_time_s)
            except FlightidError:
                continue


def _pairs(uncertain: Uncertain[Any]) -> Iterable[tuple[Any, Any]]:
    if not uncertain.known:
        return
    try:
        yield from uncertain.steps(CORNER)
    except FlightidError:
        return
