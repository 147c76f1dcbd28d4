"""Whether a record contradicts a model: errors there beyond what fit and parameters allow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

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
from flightid.identification.uncertain_of import uncertain_of
from flightid.models.model import model_of
from flightid.uncertainty.foretold import independent_samples

Array = NDArray[np.float64]
CODE = "unseen-contradicts"
FALSE_ALARMS = 0.001
"""Share of sound records that the test of the error's power calls wrong."""
BEYOND = 2.0
"""Times what is allowed up to which a misfit that the fit shows too, or other weather, makes it."""
MATERIAL, GROSS = 0.02, 0.25
"""Shares of an output's power that the error has beyond what is allowed."""
STEP = 0.01
"""Of a standard deviation: to first order, as the intervals are."""


def contradictions(
    source: object, way: Predictor, made: Sequence[Prediction], request: Request
) -> tuple[Finding, ...]:
    """A warning for each record and output whose error the fit does not allow.

    Allowed is the power of what the fit's own free run left of its records, with what the errors of
    the parameters add to this run. Their ratio is tested by Fisher's F with as many degrees of
    freedom as there are independent samples in both errors.

    Parameters
    ----------
    source : object
        Anything that can be verified; only a fit to records, or the file of its model, tells what
        it left.
    way : callable
        What predicts with it.
    made : sequence of Prediction
    request : Request

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
    found = (
        _judged(source, way, each, request, name, entry[name])
        for each in made
        for name in each.outputs
        if name in entry
    )
    return tuple(each for each in found if each is not None)


def _judged(
    source: object,
    way: Predictor,
    run: Prediction,
    request: Request,
    name: str,
    left: Mapping[str, float],
) -> Finding | None:
    y, y_hat = run.scored(name)
    error, power = y - y_hat, float(np.mean(y**2))
    size, own = float(np.mean(error**2)), float(left["rms"]) ** 2
    if not _is_beyond(size, own, power):
        return None
    known = _by_parameters(source, way, run, request, name)
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
    return Finding(
        CODE,
        Light.RED if share > GROSS and known is not None else Light.AMBER,
        f"{run.measured.name}: {name} errs by {np.sqrt(size):.3g}, {times:.2g} times what the fit "
        f"{allowed} ({100 * np.sqrt(share):.2g} % of its motion, p = {chance:.1g}): {told}",
        "fit the records together (one may excite what the other does not), or find what changed "
        "between them: operating point, gain, load",
    )


def _is_beyond(size: float, allowed: float, power: float) -> bool:
    return size > BEYOND**2 * allowed and size - allowed > MATERIAL * power


def _by_parameters(
    source: object, way: Predictor, run: Prediction, request: Request, name: str
) -> float | None:
    """Mean square of what errors of the parameters move in this run; None where none are known."""
    try:
        answer = partial(_answer, source, way, run, request, name)
        ends = uncertain_of(source).steps(STEP)
        moved = [answer(model_of(up)) - answer(model_of(down)) for up, down in ends]
    except FlightidError:
        return None
    size = [float(np.mean(np.square(each))) for each in moved]
    return float(np.nansum(size)) / (2.0 * STEP) ** 2 if size else None


def _answer(
    source: object, way: Predictor, run: Prediction, request: Request, name: str, model: object
) -> Array:
    made = way(of_record(source, model, run.measured), run.measured, (name,), request)
    return np.asarray(made.predicted[name][run.start :])
