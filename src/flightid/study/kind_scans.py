"""Scans of kinds that are fitted one by one, over the samples of a scan of polynomial orders."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from flightid.identification import Fit
from flightid.identification.prediction_error.information_criteria import Criteria, criteria
from flightid.models import InnovationsModel, NarxStructure, SubspaceStructure
from flightid.record import Record
from flightid.study.structures import RUNS_ALIKE
from flightid.study.task import narrowed
from flightid.validation.order_scan.result import OrderTrial, rank_of
from flightid.validation.order_scan.trials import ScanRecords, fitted_trials

Groups = Sequence[Sequence[Record]]
LARGEST_ORDER = 10
NEAR, REFINED = 1.2, 3
"""Subspace estimates whose free runs err by that much more than the best are refined, so many."""


def scan_narx(
    structures: Sequence[NarxStructure], settle_s: float, flown: Groups, unseen: Groups
) -> list[OrderTrial]:
    """NARX structures of one output by free run, which starts from measured lags.

    Parameters
    ----------
    structures : sequence of NarxStructure
    settle_s : float
        First stretch of a run that no score counts, s.
    flown, unseen : sequence of sequence of Record
        Records of the fits, and of the free runs.
    """
    first = structures[0]
    scan = _records(first.inputs, first.output, settle_s, flown, unseen)
    return fitted_trials(structures, scan, "NARX lags and degrees")


def scan_subspace(
    inputs: tuple[str, ...], output: str, settle_s: float, flown: Groups, unseen: Groups
) -> OrderTrial | None:
    """The subspace model of one output with the fewest states of those that run as well, or None.

    Parameters
    ----------
    inputs : tuple of str
    output : str
    settle_s : float
        First stretch of a run that no score counts, s.
    flown, unseen : sequence of sequence of Record
        Records of the fits, and of the free runs.
    """
    scan = _records(inputs, output, settle_s, flown, unseen)
    asked = [
        InnovationsModel.subspace(inputs, output, order=order, refine=False)
        for order in range(1, LARGEST_ORDER + 1)
    ]
    # An estimate costs a tenth of its refinement, and tells already how well its order runs.
    rough = _free(fitted_trials(asked, scan, "Subspace orders"))
    most = NEAR * min((_error(each) for each in rough), default=0.0)
    near = sorted((each for each in rough if _error(each) <= most), key=rank_of)[:REFINED]
    kept = [each.structure for each in near if isinstance(each.structure, SubspaceStructure)]
    refined = [replace(each, refine=True) for each in kept]
    made = _free(fitted_trials(refined, scan, "Subspace models"))
    most = (1.0 + RUNS_ALIKE) * min((_error(each) for each in made), default=0.0)
    alike = [each for each in made if _error(each) <= most]
    return min(alike, key=lambda each: each.n_parameters or 0, default=None)


def _free(trials: Iterable[OrderTrial]) -> list[OrderTrial]:
    """Those that ended at a minimum and run freely, with the criteria of their one-step errors."""
    return [
        each if each.fit is None else replace(each, criteria=_criteria(each.fit, each))
        for each in trials
        if each.settled and each.free_run_rms is not None
    ]


def _criteria(fit: Fit, trial: OrderTrial) -> Criteria:
    errors = np.concatenate([record[fit.model.outputs[0]] for record in fit.residuals])
    return criteria(float(errors @ errors), errors.size, trial.n_parameters or 0)


def _error(trial: OrderTrial) -> float:
    return trial.free_run_rms or 0.0


def _records(
    inputs: tuple[str, ...], output: str, settle_s: float, flown: Groups, unseen: Groups
) -> ScanRecords:
    told, ranked = (
        [narrowed(record, inputs, (output,)) for group in groups for record in group]
        for groups in (flown, unseen)
    )
    return ScanRecords(told, ranked, settle_s)
