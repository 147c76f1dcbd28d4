"""The fit of a model without equations: one structure, or the best of several by free run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification import Fit, identify
from flightid.identification.innovation_tests import INPUTS_IN_ERRORS
from flightid.identification.prediction_error.findings import CANCELLATION
from flightid.models import InnovationsModel, NarxStructure, PolynomialModel, SubspaceStructure
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.record import Record
from flightid.study.structure_settings import NARX, SUBSPACE, StructureSettings
from flightid.study.widened_scan import CLEAR, doubted, widened
from flightid.uncertainty.paired_errors import excess_score
from flightid.uncertainty.quantiles import half_width
from flightid.validation import NarxSearch, OrderScan, scan_orders, search_narx
from flightid.validation.order_scan.edges import Structure
from flightid.validation.order_scan.narx_search import search_further
from flightid.validation.order_scan.result import OrderTrial, is_settled
from flightid.validation.order_scan.scan_orders import scan_further
from flightid.validation.order_scan.trials import fit_of
from flightid.validation.spectra.spectra import lags_of_spectrum

Choice = OrderScan | NarxSearch
RUNS_ALIKE = 0.05
"""Free-run errors that differ by less are alike: a minute of a slow mode tells them no better."""
NEVER_ALIKE = 0.2
"""Free-run errors that differ by more are told apart, whatever slow noise may make by chance."""
BY_CHANCE = 0.9
"""Level, of two sides, of paired errors that are alike: chance takes 1 of 20 beyond."""
TRIED = 4
"""Structures that are fitted whole, at most, for one that `_is_clean`."""
FURTHER, DOUBTED = 2, 0.3
"""Of each sort beyond them where none is; how much worse their free runs may be."""
BALANCED = "balanced"


def fit_structure(
    settings: StructureSettings,
    inputs: tuple[str, ...],
    flown: Sequence[Record],
    unseen: Sequence[Record],
    scan: OrderScan | None = None,
) -> tuple[Fit, Choice | None]:
    """Fit a structure; of several the one that the study's rule takes.

    Parameters
    ----------
    settings : StructureSettings
    inputs : tuple of str
        Those with coherence.
    flown, unseen : sequence of Record
        Records of the fit, and of the choice.
    scan : OrderScan, optional
        Of polynomial structures that are tried: of these orders on these records. Default: made.

    Returns
    -------
    tuple of Fit and (OrderScan, NarxSearch or None)
        The fit, and what was tried.
    """
    if settings.structure == SUBSPACE:
        return _subspace(settings, inputs, list(flown)), None
    if settings.structure == NARX:
        return _narx(settings, inputs, list(flown), list(unseen))
    return _polynomial(settings, inputs, list(flown), list(unseen), scan)


def _polynomial(
    settings: StructureSettings,
    inputs: tuple[str, ...],
    flown: list[Record],
    unseen: list[Record],
    scan: OrderScan | None,
) -> tuple[Fit, OrderScan | None]:
    (output,) = settings.outputs
    if scan is None and settings.scans_orders:
        tried: dict[str, Any] = {**settings.orders, **settings.options}
        kind = settings.structure
        scan = scan_orders(flown, unseen, kind=kind, inputs=inputs, outputs=output, **tried)
    if scan is None:
        orders: dict[str, Any] = {name: values[0] for name, values in settings.orders.items()}
        asked = PolynomialModel.general(inputs, output, **orders, **settings.options)
        return identify(asked, flown), None

    def beyond(
        scan: OrderScan, taken: Callable[[OrderScan], Structure]
    ) -> tuple[OrderScan, tuple[Finding, ...]]:
        return widened(
            scan,
            lambda each: [trial.structure for trial in each.trials],
            taken,
            lambda each, structures: scan_further(each, structures, flown, unseen),
        )

    wide, findings = beyond(scan, lambda each: ranked(each, settings.rule)[0].structure)
    first = ranked(wide, settings.rule)[0].structure
    fit = _cleanest(wide, settings.rule, flown)
    delivered = fit.structure
    if isinstance(delivered, PolynomialStructure) and delivered.orders_text != first.orders_text:
        wide, findings = beyond(wide, lambda _: delivered)
    return doubted(fit, findings), wide


def _subspace(settings: StructureSettings, inputs: tuple[str, ...], flown: list[Record]) -> Fit:
    """Of the order that is asked, or that free runs take of all up to the largest."""
    asked = InnovationsModel.subspace(inputs, settings.outputs, **settings.options)
    fit = identify(asked, flown)
    if asked.order is not None:
        return fit

    def further(_: Fit, structures: list[Structure]) -> tuple[Fit, tuple[OrderTrial, ...]]:
        largest = max(each.order or 0 for each in structures if isinstance(each, SubspaceStructure))
        return identify(replace(asked, maximum_order=largest), flown), ()

    fit, findings = widened(
        fit,
        lambda each: [replace(asked, order=n + 1) for n in range(_largest(each))],
        lambda each: replace(asked, order=each.model.order),
        further,
    )
    return doubted(fit, findings)


def _largest(fit: Fit) -> int:
    """Largest order that the choice considered."""
    structure = fit.structure
    return structure.maximum_order if isinstance(structure, SubspaceStructure) else 0


def _cleanest(scan: OrderScan, choose: str, flown: list[Record]) -> Fit:
    """The first of a rule's trials whose fit leaves no doubt of its structure, or the first of all.

    A search that ended at no minimum or at one of several as good, or a pole and its zero that
    cancel, say little of a mode; errors that the inputs foretell say that dynamics are missing.
    """
    order = ranked(scan, choose)
    first = scan.best if order[0] is scan.trials[0] else fit_of(order[0], flown)
    if _is_clean(first):
        return first
    others = order[1:TRIED]
    if choose == BALANCED:
        others += [each for each in _less_sure(scan, order[0]) if each not in others]
    elif choose == "free_run":
        others += [each for each in _next_best(scan) if each not in others]
    fits = (scan.best if each is scan.trials[0] else fit_of(each, flown) for each in others)
    return next((fit for fit in fits if _is_clean(fit)), first)


def _is_clean(fit: Fit) -> bool:
    doubts = {each.code for each in fit.findings if each.light is not Light.GREEN}
    return is_settled(fit) and not doubts & {CANCELLATION, INPUTS_IN_ERRORS, "local-minima"}


def _next_best(scan: OrderScan) -> list[OrderTrial]:
    """The next trials by free run, for a best one that its own fit puts in doubt."""
    most = (1 + DOUBTED) * (scan.trials[0].free_run_rms or 0.0)
    return [
        each
        for each in scan.trials[1:TRIED]
        if each.settled and each.free_run_rms is not None and each.free_run_rms <= most
    ]


def _less_sure(scan: OrderScan, taken: OrderTrial) -> list[OrderTrial]:
    """Structures beyond a rule's choice, for one that its own fit puts in doubt.

    Those that are clearly likelier and run not much worse, for the records of the choice may be
    short; and those with fewer coefficients that run as well: where errors are slow, likelihoods
    of white errors differ by many times 6 for nothing, and chance takes a pole too many.
    """
    least = scan.trials[0]
    known = {
        place: (_aicc(trial), trial.free_run_rms)
        for place, trial in enumerate(scan.trials)
        if trial.settled
        and trial.free_run_rms is not None
        and _has_zeros_of_sampling(trial.structure)
    }
    likelier, fewer = [], []
    for place, (aicc, rms) in sorted(known.items(), key=lambda each: each[1]):
        trial = scan.trials[place]
        if aicc < _aicc(taken) - CLEAR and rms <= (1 + DOUBTED) * (least.free_run_rms or 0.0):
            likelier.append(trial)
        elif (trial.n_parameters or 0) < (taken.n_parameters or 0) and runs_as_well(trial, least):
            fewer.append(trial)
    return [*likelier[:FURTHER], *fewer[:FURTHER]]


def _aicc(trial: OrderTrial) -> float:
    known = None if trial.likelihood is None else trial.likelihood.aicc
    return math.inf if known is None else known


def runs_as_well(trial: OrderTrial, best: OrderTrial) -> bool:
    """Whether a free run errs no more than the best one, but for what chance makes of errors.

    A run that slow noise has carried off its level tells little of what follows the inputs, and a
    pole slower than the run starts at the level of its first stretch. Both runs hold the same
    noise, so their errors are compared sample by sample (`excess_score`). Where a plant drifts, few
    errors are independent and chance allows much; likelihoods then prefer what runs far worse.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> asked = fid.PolynomialModel.oe("u", "y", nb=1, nf=1)
    >>> def ran(errors):
    ...     return OrderTrial(asked, None, None, float(np.std(errors)), 90.0, errors=(errors,))
    >>> noise, miss = np.random.default_rng(0).standard_normal((2, 500))
    >>> best, other = ran(noise), ran(noise + 0.5 * miss)
    >>> slow_best, slow = (ran(np.repeat(each[:5], 100)) for each in (noise, noise + 0.5 * miss))
    >>> runs_as_well(other, best), runs_as_well(slow, slow_best)
    (False, True)
    """
    if trial.free_run_rms is None or best.free_run_rms is None:
        return False
    if trial.free_run_rms <= (1 + RUNS_ALIKE) * best.free_run_rms:
        return True
    far = trial.free_run_rms > (1 + NEVER_ALIKE) * best.free_run_rms
    if far or not trial.errors or not best.errors:
        return False
    return excess_score(trial.errors, best.errors) < half_width(BY_CHANCE)


def ranked(scan: OrderScan, how: str) -> list[OrderTrial]:
    """Trials that a rule takes: first, second, … of those whose free run is as good.

    Parameters
    ----------
    scan : OrderScan
    how : str
        One of `CHOICES`.
    """
    first = scan.trials[0]
    if how == "simplest":
        return [scan.simplest]
    if how == "bic":
        return [scan.smallest("bic")]
    if first.free_run_rms is None:
        return [first]
    alike = [
        (not _has_zeros_of_sampling(trial.structure), _aicc(trial), place)
        for place, trial in enumerate(scan.trials)
        if math.isfinite(_aicc(trial)) and trial.settled and runs_as_well(trial, first)
    ]
    order = _by_evidence(scan, alike) if how == BALANCED else alike
    return [scan.trials[each[-1]] for each in order] or [first]


def _by_evidence(
    scan: OrderScan, alike: list[tuple[bool, float, int]]
) -> list[tuple[bool, float, int]]:
    """First those that no other is clearly better than, the one with fewest coefficients first.

    Of dozens of structures some that are too rich win by chance, with a pole that is none and a
    delay that is none (Burnham & Anderson (2002), Model Selection and Multimodel Inference, 2.6).
    """
    least = min(alike, default=(False, 0.0, 0))[1]

    def key(each: tuple[bool, float, int]) -> tuple[bool, bool, int, float, int]:
        lacking, aicc, place = each
        clear = aicc > least + CLEAR
        return lacking, clear, 0 if clear else scan.trials[place].n_parameters or 0, aicc, place

    return sorted(alike, key=key)


def _has_zeros_of_sampling(structure: Structure) -> bool:
    """Whether B has as many coefficients as F, as a strictly proper system that is sampled has.

    Where slow inputs hardly tell them, fewer make every bar at high frequencies too short: what
    the structure forbids has no share in them (Åström, Hagander & Sternby (1984), Automatica 20).
    """
    if not isinstance(structure, PolynomialStructure):
        return True
    return all(nb >= nf for nb, nf in zip(structure.nb, structure.nf, strict=True))


def _narx(
    settings: StructureSettings, inputs: tuple[str, ...], flown: list[Record], unseen: list[Record]
) -> tuple[Fit, NarxSearch | None]:
    outputs_back, inputs_back = settings.orders["output_lags"], settings.orders["input_lags"]
    told: tuple[Finding, ...] = ()
    if not outputs_back:
        count, finding = lags_of_spectrum(flown, inputs, settings.outputs[0])
        outputs_back, told = (count,), (finding,)
    asked = NarxStructure(
        inputs,
        settings.outputs[0],
        outputs_back[0],
        inputs_back[0],
        width=settings.widths[0],
        **settings.options,
    )
    if not settings.is_scanned:
        fit = identify(asked, flown)
        return replace(fit, findings=(*told, *fit.findings)), None
    pairs = [(a, b) for a in outputs_back for b in inputs_back]
    search, findings = widened(
        search_narx(asked, flown, unseen, lags=pairs, widths=settings.widths),
        lambda each: [trial.structure for trial in each.trials],
        lambda each: each.trials[0].structure,
        lambda each, structures: (search_further(each, structures, flown, unseen), ()),
    )
    fit = doubted(search.best, findings)
    return replace(fit, findings=(*told, *fit.findings)), search


def goal_findings(fit: Fit | None) -> tuple[Finding, ...]:
    """Whether the sum of squares that a NARX structure was asked for was reached."""
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
