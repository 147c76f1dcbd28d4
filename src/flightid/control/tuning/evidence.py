"""What the data allow gains to rest on: the plants that may be, the band, and what forbids it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.dynamics.continuous import to_continuous
from flightid.errors import DataError, FlightidError
from flightid.findings import Finding
from flightid.identification.uncertain_of import evidence_behind, uncertain_of
from flightid.models import InnovationsModel, PolynomialModel
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.model import linear_system, model_of
from flightid.uncertainty.uncertain import Uncertain

CORNER = 2.0
"""Standard deviations from the estimate to the corners that a search begins with."""
Band = tuple[float, float]
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
    coherences : mapping of str to tuple of ndarray
        By ``"output/input"`` of the fitted responses: frequencies (rad/s) and coherence.
    """

    estimate: LinearSystem
    corners: tuple[LinearSystem, ...]
    draws: tuple[LinearSystem, ...]
    fresh: tuple[LinearSystem, ...]
    band_rad_s: Band | None
    hold_in_model: bool
    findings: tuple[Finding, ...]
    coherences: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)

    @property
    def sources(self) -> tuple[LinearSystem, ...]:
        """Estimate, corners and draws."""
        return (self.estimate, *self.corners, *self.draws)


def gather(
    source: object,
    sample_time_s: float,
    *,
    draws: int,
    fresh: int,
    seed: int,
    band_rad_s: Band | None,
    verification: Verdicts | Iterable[Verdicts] | None,
    nominal: bool,
) -> TuningEvidence:
    """Collect plants, or refuse where the data cannot carry gains.

    Parameters
    ----------
    source : fit or model
    sample_time_s : float
        Of the autopilot's loop, s.
    draws, fresh : int
        Draws for the search, and others to judge its result by.
    seed : int
    band_rad_s : tuple of float or None
        Identified band, rad/s; None: that of the fit's responses.
    verification : Verification or several, optional
        Predictions of records that the fit has not seen.
    nominal : bool
        Go on without a covariance.

    Returns
    -------
    TuningEvidence

    Raises
    ------
    DataError
        No covariance; a fit or a verification that is red.
    """
    found = _judged(source)
    _refuse_red("the fit", source)
    for each in _listed(verification):
        _refuse_red("the verification", each)
    uncertain: Uncertain[Any] = uncertain_of(source)
    findings: list[Finding] = [*found]
    if not uncertain.known:
        if not nominal:
            raise DataError(
                "gains for a model whose errors are not known would promise nothing",
                found=uncertain.reason,
                needed="a fit with a covariance",
                action="fit a measured response or records; or take nominal=True and keep margins",
            )
        findings.append(
            Finding(
                "no-uncertainty",
                Light.AMBER,
                f"margins are those of the model alone: {uncertain.reason}",
                "identify the vehicle, and keep more margin until then",
            )
        )
    band = band_rad_s or _band(source)
    if band is None:
        findings.append(
            Finding(
                "band-unknown",
                Light.UNKNOWN,
                "nothing says up to which frequency the model was identified",
                "give band_rad_s, so that the crossover stays inside",
            )
        )
    plants = [_linear(each, sample_time_s) for each in uncertain.draws(draws + fresh, seed)]
    return TuningEvidence(
        _linear(uncertain.value, sample_time_s),
        tuple(_corners(uncertain, sample_time_s)),
        tuple(plants[:draws]),
        tuple(plants[draws:]),
        band,
        _hold_in_model(source),
        tuple(findings),
        {
            each.name: (each.measured.omega_rad_s, each.measured.coherence)
            for each in getattr(source, "responses", ())
            if hasattr(each, "measured")
        },
    )


def _listed(given: Verdicts | Iterable[Verdicts] | None) -> Sequence[Verdicts]:
    if given is None:
        return ()
    return tuple(given) if isinstance(given, Iterable) else (given,)


def _judged(source: object) -> tuple[Finding, ...]:
    """The light of a fit's evidence: red is refused, amber goes on with its gains."""
    examined = evidence_behind(source)
    if examined is None:
        return ()
    verdict = examined.verdict
    if verdict.light is Light.RED:
        raise DataError(
            "the fit is red, so no gains are made from it",
            found=verdict.message,
            needed="a model that its data support",
            action=verdict.action or None,
        )
    if verdict.light is Light.GREEN:
        return ()
    text = f"gains rest on a fit that is {verdict.light}: {verdict.message}"
    return (Finding("fit-evidence", verdict.light, text, verdict.action),)


def _refuse_red(what: str, result: object) -> None:
    for finding in getattr(result, "findings", ()):
        if finding.light is Light.RED:
            raise DataError(
                f"{what} is red, so no gains are made from it",
                found=finding.message,
                needed="a model that its data support",
                action=finding.action or None,
            )


def _band(source: object) -> Band | None:
    """What all fitted responses have in common."""
    known_of = getattr(source, "estimated", None)
    bands = list(known_of.bands.values()) if known_of is not None else []
    known = [band for band in bands if band is not None]
    if not known or len(known) < len(bands):
        return None
    lows, highs = zip(*known, strict=True)
    return max(lows), min(highs)


def _hold_in_model(source: object) -> bool:
    """A fit that was told of held inputs keeps the half sample out of its delay."""
    provenance = getattr(getattr(source, "estimated", source), "provenance", {})
    options = provenance.get("options", provenance) if isinstance(provenance, Mapping) else {}
    hold = options.get("hold", provenance.get("hold")) if isinstance(options, Mapping) else None
    return hold != "zero"


def _linear(source: object, sample_time_s: float) -> LinearSystem:
    """Continuous system, or a recursion at the loop's own samples."""
    model = model_of(source)
    if isinstance(model, PolynomialModel | InnovationsModel):
        if abs(model.sample_time_s / sample_time_s - 1.0) > 1e-6:
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
