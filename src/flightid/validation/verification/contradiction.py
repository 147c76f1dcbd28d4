"""Whether a record contradicts a model: errors there beyond what fit and parameters allow."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.identification.left_by_fit import LEFT
from flightid.identification.prediction.predict import Predictor
from flightid.identification.prediction.remembered import of_record, provenance_entry
from flightid.identification.prediction.request import FREE_RUN, Request
from flightid.identification.prediction.result import Prediction
from flightid.identification.prediction.weights import guide_factor
from flightid.identification.uncertain_of import uncertain_of
from flightid.models.model import model_of
from flightid.uncertainty.foretold import independent_samples
from flightid.validation.verification.foretold_error import LEVEL, chances_by_output
from flightid.validation.verification.refuted_parameters import QuestionedRuns

Array = NDArray[np.float64]
CODE = "unseen-contradicts"
FALSE_ALARMS = 0.001
"""Share of sound records that the test of the error's power calls wrong."""
BEYOND = 2.0
"""Times what is allowed up to which a misfit that the fit shows too, or other weather, makes it."""
MATERIAL, GROSS = 0.02, 0.25
"""Shares of an output's power that the error has beyond what is allowed."""
GUSTS = (
    "inputs foretell none of the errors: gusts beyond those of the fit's records may be it, or the "
    "vehicle differs, and this record does not tell which"
)
STEP = 0.01
"""Of a standard deviation: to first order, as the intervals are."""


def contradictions(
    source: object,
    way: Predictor,
    made: Sequence[Prediction],
    request: Request,
    asked: QuestionedRuns | None = None,
) -> tuple[Finding, ...]:
    """A warning for each record and output whose error the fit does not allow.

    Allowed is the power of what the fit's own free run left of its records, with what the errors of
    the parameters add to this run. Their ratio is tested by Fisher's F with as many degrees of
    freedom as there are independent samples in both errors. None is red where inputs foretell no
    error: a right model errs so in more gust than the fit's records had.

    Parameters
    ----------
    source : object
        Anything that can be verified; only a fit to records, or the file of its model, tells what
        it left.
    way : callable
        What predicts with it.
    made : sequence of Prediction
    request : Request
    asked : QuestionedRuns, optional
        Where inputs ask other parameters, gusts are no excuse.

    Assumes
    -------
    Noise of the record as large as that of the records of the fit, to `BEYOND` times. Errors of
    the vehicle that are smaller are not seen.

    Reference
    ---------
    Bayley & Hammersley (1946), The effective number of independent observations in an
    autocorrelated time series, JRSS Supplement 8(2); Ljung, *System Identification*, 2nd ed.,
    section 16.5.
    """
    entry = provenance_entry(source, LEFT)
    if not isinstance(entry, Mapping) or request.horizon != FREE_RUN:
        return ()
    asked = asked or QuestionedRuns()
    alone = cache(partial(_no_input_foretells, made, asked.innovations))

    def excused() -> bool:
        return not asked.is_refuted and alone()

    found = []
    for run in made:
        moved = cache(partial(_by_parameters, source, way, run, request))
        told = (name for name in run.outputs if name in entry)
        beyond = (_judged(run, name, entry[name], moved, excused) for name in told)
        found += [each for each in beyond if each is not None]
    return tuple(found)


def _judged(
    run: Prediction,
    name: str,
    left: Mapping[str, float],
    moved: Callable[[], Mapping[str, float]],
    excused: Callable[[], bool],
) -> Finding | None:
    y, y_hat = run.scored(name)
    error, power = y - y_hat, float(np.mean(y**2))
    size, own = float(np.mean(error**2)), float(left["rms"]) ** 2
    if not _is_beyond(size, own, power):
        return None
    known = moved().get(name)
    own += known or 0.0
    freedom = (independent_samples([error]), float(left["independent_samples"]))
    chance = float(scipy.special.fdtrc(*freedom, size / max(own, np.finfo(float).tiny)))
    if not _is_beyond(size, own, power) or chance > FALSE_ALARMS:
        return None
    share = (size - own) / power
    times = np.sqrt(size / own) if own > 0.0 else np.inf
    allowed = "and its intervals allow" if known is not None else "left of its own records"
    told = "intervals of this model do not hold here"
    if known is None:
        told = "it has no intervals, and knows less than this record asks"
    light = Light.RED if share > GROSS and known is not None else Light.AMBER
    if excused():
        # A right model errs so in more gust than its fit knew, and its intervals hold.
        light, told = Light.AMBER, GUSTS
    return Finding(
        CODE,
        light,
        f"{run.measured.name}: {name} errs by {np.sqrt(size):.3g}, {times:.2g} times what the fit "
        f"{allowed} ({100 * np.sqrt(share):.2g} % of its motion, p = {chance:.1g}): {told}",
        "fit the records together (one may excite what the other does not), or find what changed "
        "between them: operating point, gain, load",
    )


def _is_beyond(size: float, allowed: float, power: float) -> bool:
    return size > BEYOND**2 * allowed and size - allowed > MATERIAL * power


def _no_input_foretells(made: Sequence[Prediction], innovations: Sequence[Array]) -> bool:
    """Whether no output's error is foretold by the inputs, as none of a right model in gusts is.

    Gusts move what flies: motions in the units of these alone are asked.
    """
    if all(guide_factor(made[0].measured.unit(name)) is None for name in made[0].outputs):
        return False
    chances = chances_by_output(made, innovations)
    return bool(chances) and min(chances.values()) >= LEVEL


def _by_parameters(
    source: object, way: Predictor, run: Prediction, request: Request
) -> dict[str, float]:
    """Mean squares of what errors of the parameters move in this run; none where none are known.

    All outputs are predicted together, as they were in the run: start and biases are solved for on
    them, and one alone tells too little of these.
    """
    try:
        answer = partial(_answer, source, way, run, request)
        ends = uncertain_of(source).steps(STEP)
        moved = [answer(model_of(up)) - answer(model_of(down)) for up, down in ends]
    except FlightidError:
        return {}
    if not moved:
        return {}
    size = np.nansum([np.mean(np.square(each), axis=1) for each in moved], axis=0)
    return dict(zip(run.outputs, map(float, size / (2.0 * STEP) ** 2), strict=True))


def _answer(
    source: object, way: Predictor, run: Prediction, request: Request, model: object
) -> Array:
    made = way(of_record(source, model, run.measured), run.measured, run.outputs, request)
    return np.array([made.predicted[name][run.start :] for name in run.outputs])
