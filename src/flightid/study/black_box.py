"""The stages of a black-box model in a study, from the coherence test to the spectra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from flightid.conventions import Light, Role
from flightid.findings import Finding
from flightid.identification import Fit, identify
from flightid.inspection import Inspection
from flightid.models import NarxStructure, PolynomialModel
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.record import Record
from flightid.responses import CoherentPairs, FrequencyResponse, coherent_pairs, estimate_response
from flightid.study.black_box_settings import NARX, BlackBoxSettings
from flightid.study.evidence import examined
from flightid.validation import (
    CrossValidation,
    NarxSearch,
    OrderScan,
    ResidualTests,
    SpectrumComparison,
    compare_spectra,
    cross_validate,
    residual_tests,
    scan_orders,
    search_narx,
)

N_FREQUENCIES = 60
AS_GOOD = 0.10
"""Free-run errors that differ by less are alike: a minute of a slow mode tells them no better."""


@dataclass(frozen=True, eq=False)
class BlackBox:
    """What a study made of one black-box model.

    Attributes
    ----------
    settings : BlackBoxSettings
        What was asked.
    response : FrequencyResponse
        Estimate behind the coherence test.
    coherent : CoherentPairs
        The coherence test; inputs it does not keep are left out.
    choice : OrderScan, NarxSearch or None
        Structures that were tried, where there were several.
    fit : Fit or None
        None where no input is left.
    tests : ResidualTests or None
        Of errors one step ahead on the records of the fit.
    cross : CrossValidation or None
        On the records of the verification.
    spectra : SpectrumComparison or None
        Of the first record of the coherence test, measured and in free run.
    """

    settings: BlackBoxSettings
    response: FrequencyResponse
    coherent: CoherentPairs
    choice: OrderScan | NarxSearch | None = None
    fit: Fit | None = None
    tests: ResidualTests | None = None
    cross: CrossValidation | None = None
    spectra: SpectrumComparison | None = None

    @property
    def left_out(self) -> tuple[Finding, ...]:
        """Inputs without coherence, with the reason."""
        return tuple(
            Finding("left-out", Light.UNKNOWN, f"{pair.name} is left out: {pair.reason}")
            for pair in self.coherent.pairs
            if not pair.kept
        )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdicts of all stages."""
        parts = (self.fit, self.tests, self.cross, self.spectra)
        found = (finding for part in parts if part is not None for finding in part.findings)
        return (*self.left_out, *self.choice_findings, *self.goal_findings, *found)

    @property
    def goal_findings(self) -> tuple[Finding, ...]:
        """Whether the sum of squares that was asked for was reached."""
        fit = self.fit
        structure = None if fit is None else fit.structure
        if fit is None or not isinstance(structure, NarxStructure) or structure.stop != "sse":
            return ()
        reached = fit.objective
        if reached <= structure.goal:
            return ()
        message = (
            f"the sum of squares is {reached:.3g} after {len(fit.parameters)} terms; the goal of "
            f"{structure.goal:.3g} was not reached"
        )
        action = "sensor noise may lie above the goal: stop by 'press', or allow more terms"
        return (Finding("goal-not-reached", Light.AMBER, message, action),)

    @property
    def choice_findings(self) -> tuple[Finding, ...]:
        """Verdicts of the search on its first structure, where that one is taken."""
        if self.choice is None or self.settings.choose != "free_run":
            return ()
        return self.choice.findings

    def to_dict(self) -> dict[str, object]:
        """Plain values of every stage."""
        stages = {
            "coherence": self.coherent,
            "choice": self.choice,
            "fit": self.fit,
            "residual_tests": self.tests,
            "cross_validation": self.cross,
            "spectra": self.spectra,
        }
        plain = {key: None if part is None else part.to_dict() for key, part in stages.items()}
        return {
            "name": self.settings.name,
            "structure": self.settings.structure,
            "left_out": [finding.to_dict() for finding in self.left_out],
            **plain,
        }


def identify_black_box(
    settings: BlackBoxSettings,
    records: Mapping[str, Record],
    inspection: Inspection | None = None,
) -> BlackBox:
    """Carry out every stage of one black-box model.

    Parameters
    ----------
    settings : BlackBoxSettings
        What is asked.
    records : mapping of str to Record
        By name.
    inspection : Inspection, optional
        Of the log that they come from.

    Returns
    -------
    BlackBox

    Raises
    ------
    FlightidError
        A stage refuses its data; the message is that stage's.
    """
    gate = [_narrowed(records[name], settings, settings.inputs) for name in settings.coherence]
    response = estimate_response(
        gate,
        inputs=settings.inputs,
        outputs=[settings.output],
        band_rad_s=settings.band_rad_s,
        n_omega=N_FREQUENCIES,
    )
    coherent = coherent_pairs(
        response,
        minimum_coherence=settings.minimum_coherence,
        minimum_decades=settings.minimum_decades,
    )
    inputs = tuple(
        name for name in settings.inputs if f"{settings.output}/{name}" in coherent.names
    )
    if not inputs:
        return BlackBox(settings, response, coherent)

    def taken(names: Sequence[str]) -> list[Record]:
        return [_narrowed(records[name], settings, inputs) for name in names]

    flown, unseen = taken(settings.identify), taken(settings.select)
    choice, fit = (
        _narx(settings, inputs, flown, unseen)
        if settings.structure == NARX
        else _polynomial(settings, inputs, flown, unseen)
    )
    seen = taken(settings.coherence)[0]
    run = cross_validate(fit, seen, horizons=("free_run",)).of(seen.name)
    box = BlackBox(
        settings,
        response,
        coherent,
        choice,
        fit,
        residual_tests(fit),
        cross_validate(fit, taken(settings.verify)) if settings.verify else None,
        compare_spectra(seen, run.predicted_record()),
    )
    beyond = [finding for finding in box.findings if finding not in fit.findings]
    return replace(box, fit=examined(fit, inspection, beyond))


def _narrowed(record: Record, settings: BlackBoxSettings, inputs: Sequence[str]) -> Record:
    """The channels of the model alone, in its roles: another model may see them otherwise."""
    roles = {**dict.fromkeys(inputs, Role.INPUT), settings.output: Role.OUTPUT}
    return record.select(roles).with_roles(**roles)


def _polynomial(
    settings: BlackBoxSettings,
    inputs: tuple[str, ...],
    flown: list[Record],
    unseen: list[Record],
) -> tuple[OrderScan | None, Fit]:
    if not settings.is_scanned:
        orders: dict[str, Any] = {name: values[0] for name, values in settings.orders.items()}
        asked = PolynomialModel.general(inputs, settings.output, **orders, **settings.options)
        return None, identify(asked, flown)
    tried: dict[str, Any] = {"kind": settings.structure, **settings.orders, **settings.options}
    scan = scan_orders(flown, unseen, outputs=settings.output, inputs=inputs, **tried)
    chosen = _chosen(scan, settings.choose)
    fit = scan.best if chosen == scan.trials[0].structure else identify(chosen, flown)
    return scan, fit


def _chosen(scan: OrderScan, how: str) -> PolynomialStructure:
    if how == "simplest":
        return scan.simplest.structure
    if how == "bic":
        return scan.smallest("bic").structure
    first = scan.trials[0]
    if how == "free_run" or first.free_run_rms is None:
        return first.structure
    limit = (1 + AS_GOOD) * first.free_run_rms
    alike = [
        (trial.criteria.bic, place)
        for place, trial in enumerate(scan.trials)
        if trial.criteria is not None
        and trial.free_run_rms is not None
        and trial.free_run_rms <= limit
    ]
    return scan.trials[min(alike)[1]].structure if alike else first.structure


def _narx(
    settings: BlackBoxSettings,
    inputs: tuple[str, ...],
    flown: list[Record],
    unseen: list[Record],
) -> tuple[NarxSearch | None, Fit]:
    outputs_back, inputs_back = settings.orders["output_lags"], settings.orders["input_lags"]
    model = NarxStructure(
        settings.output,
        inputs,
        outputs_back[0],
        inputs_back[0],
        width=settings.widths[0],
        **settings.options,
    )
    if not settings.is_scanned:
        return None, identify(model, flown)
    pairs = [(a, b) for a in outputs_back for b in inputs_back]
    search = search_narx(model, flown, unseen, lags=pairs, widths=settings.widths)
    return search, search.best
