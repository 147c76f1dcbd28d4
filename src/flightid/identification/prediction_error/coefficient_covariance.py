"""Covariance of a polynomial model's coefficients, as far as its prediction errors allow one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.innovation_tests import ROUNDING, InnovationTests, innovation_tests
from flightid.identification.local_minimum import LocalMinimum
from flightid.identification.prediction_error.coloured_errors import (
    answers,
    has_noise_model,
    noise_bias,
    output_error_covariance,
)
from flightid.identification.prediction_error.curved_ends import FARTHEST, reaches
from flightid.identification.prediction_error.excited_inputs import noise_free_inputs
from flightid.identification.prediction_error.findings import ELSEWHERE, NOISE_AT_CIRCLE
from flightid.identification.prediction_error.likelihoods import ALIKE
from flightid.identification.prediction_error.own_past import with_own_past
from flightid.identification.prediction_error.part_blocks import errors_at, part_blocks
from flightid.identification.prediction_error.roots import farthest
from flightid.identification.residual_evidence import EXACT, NOTHING, least_gain
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.uncertainty.agreement import Agreement
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import (
    residual_covariance,
    white_covariance,
)
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.fitted_correlation import FittedCorrelation
from flightid.uncertainty.foretold import chance_share, independent_samples, likelihood_gain
from flightid.uncertainty.quantiles import LEVEL, half_width
from flightid.uncertainty.residual_colour import Colour

Array = NDArray[np.float64]
UNDETERMINED = "the data do not tell the coefficients apart"
NOISE_MODEL = "prediction errors are not white, so the noise model's coefficients are not its truth"
DRIFT = "a root of D may lie on the unit circle, where its errors to first order do not hold"
UNIT_ROOT = 2.86
"""Standard errors that 5 % of estimates of a root at one lie further inside, with a level fitted.

Reference: Dickey & Fuller (1979), J. American Statistical Association 74, 427-431.
"""

SLOW = 0.05
"""Independent samples over samples below which noise seems to follow inputs: AR(0.95)."""
SHORT = 2000
"""Samples up to which past errors are asked beside the regressors; correlations tell beyond it."""
FAR = 5.0
"""Bars between two minima beyond which neither's hold the other."""


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Coefficients with what the search left; `skip` first errors of each record do not count.

    `behind` tells how far minima lie below the first in likelihood, where colour was taken out;
    `reach` how far ends lie over those to first order, (n, 2), where the cost is no parabola.
    """

    theta: Array
    covariance: Array | None
    degrees: int
    minima: tuple[LocalMinimum, ...]
    iterations: int
    memory: list[list[float]]
    skip: int
    freedom: Array | None = None
    colour: Colour = Colour()
    agreement: Agreement | None = None
    reason: str = UNDETERMINED
    noise_reason: str = ""
    correlations: tuple[FittedCorrelation, ...] = ()
    behind: tuple[float, ...] = ()
    reach: Array | None = None


def shares_poles(structure: PolynomialStructure) -> bool:
    """Whether errors that are not white bias the vehicle's coefficients, or a prior's bars."""
    regressed = structure.na > 0 and structure.method != "iv4"
    return regressed or structure.kernel is not None


def is_white(structure: PolynomialStructure, tests: InnovationTests) -> bool:
    """Whether the covariance is that of white errors."""
    return has_noise_model(structure) and structure.method != "iv4" and tests.is_white


def tests_of(
    structure: PolynomialStructure,
    data: SampledChannels,
    counted: Sequence[Array],
    found: SearchResult,
) -> InnovationTests:
    """Whiteness of the errors that count, and their independence of the inputs."""
    skip = found.skip
    tests = innovation_tests(
        [row[None] for row in counted],
        [data.external[:, span][:, skip:] for span in data.spans],
        [data.output[None, span] for span in data.spans],
        spent(structure),
    )
    errors, lengths = np.concatenate(counted), [row.size for row in counted]
    ratio = _ratio(data, errors)
    asked = shares_poles(structure) and structure.kernel is None
    if not asked or errors.size > SHORT or found.covariance is None or ratio <= ROUNDING:
        return tests
    at = partial(errors_at, structure, data, found.memory)
    blocks = part_blocks(at, data, found.theta, skip)
    slopes = np.concatenate([each.projected for each in blocks])
    return with_own_past(tests, slopes, errors, lengths, ratio)


def spent(structure: PolynomialStructure) -> tuple[int, int]:
    """Coefficients that shape the errors' correlation with themselves, and with an input."""
    return (
        structure.na + structure.nc + structure.nd,
        max((b + f for b, f in zip(structure.nb, structure.nf, strict=True)), default=0),
    )


def compared(
    structure: PolynomialStructure,
    data: SampledChannels,
    found: SearchResult,
    errors: Array,
    tests: InnovationTests,
) -> SearchResult:
    """Covariance of the coefficients after parts of the data were compared.

    By the colour of residuals where no noise model answers for it; none where estimates are biased,
    and none where residuals are rounding: its sums of squares tell no error of the estimates.
    """
    alone = not has_noise_model(structure) and structure.kernel is None
    by_slopes = alone and found.agreement is None
    made = _compared(structure, data, found, errors, tests)
    return _curved(structure, data, made) if by_slopes else made


def _compared(
    structure: PolynomialStructure,
    data: SampledChannels,
    found: SearchResult,
    errors: Array,
    tests: InnovationTests,
) -> SearchResult:
    plain = found.covariance
    if plain is None or _ratio(data, errors) <= ROUNDING:
        return found if plain is None else replace(found, covariance=None, reason=EXACT)
    if found.agreement is None and not has_noise_model(structure) and structure.kernel is None:
        known = output_error_covariance(structure, data, found.theta, errors, found.skip)
        found = replace(
            found,
            covariance=known.covariance,
            freedom=known.freedom,
            colour=known.colour,
            agreement=known.agreement,
            correlations=known.correlations,
        )
    elif found.agreement is None:
        at = partial(errors_at, structure, data, found.memory)
        blocks = part_blocks(at, data, found.theta, found.skip)
        agreed = white_covariance(blocks, plain, found.degrees, grown=True)
        freedom = agreed.freedom if agreed.agreement.by_scatter is not None else None
        found = replace(
            found,
            covariance=agreed.covariance,
            freedom=freedom,
            agreement=agreed.agreement,
            colour=Colour(growth=agreed.most_growth),
        )
        if not shares_poles(structure) and structure.method != "iv4":
            found = _by_colour(structure, data, found, errors, None if tests.is_white else blocks)
    if _reach(structure, found.theta, plain, "c") >= 1.0:
        return replace(found, covariance=None, reason=NOISE_AT_CIRCLE)
    if _reach(structure, found.theta, plain, "d", UNIT_ROOT) >= 1.0:
        found = replace(found, noise_reason=DRIFT)
    tests = judged_tests(tests, data, found, errors)
    # Inputs that are fed back hold noise of the output: what was injected is what tells.
    excited = replace(data, inputs=noise_free_inputs(data))
    told_errors = (
        errors
        if data.excitations is None
        else errors_at(structure, excited, found.memory, found.theta)
    )
    if not has_noise_model(structure) and _tells_nothing(data, told_errors, plain):
        return replace(found, covariance=None, reason=NOTHING)
    times = tests.widening(biased=shares_poles(structure))
    if times is None:
        return replace(found, covariance=None, reason=tests.why_biased)
    if _fits_elsewhere(found):
        return replace(found, covariance=None, reason=ELSEWHERE)
    return found if times == 1.0 else widened(found, times)


def _curved(
    structure: PolynomialStructure, data: SampledChannels, found: SearchResult
) -> SearchResult:
    """Ends by the cost itself; the covariance, for what is computed, longer by their mean."""
    if found.covariance is None or not any(structure.nf):
        return found
    count = found.theta.size
    freedom = [found.degrees] * count if found.freedom is None else found.freedom.tolist()
    quantiles = np.array([half_width(LEVEL, each) for each in freedom])
    bars = quantiles * np.sqrt(np.diag(found.covariance))
    reach = reaches(structure, data, found.theta, found.memory, found.skip, bars)
    if reach is None:
        return found
    reach = np.minimum(reach, FARTHEST)
    return replace(widened(found, float(np.mean(reach))), reach=reach)


def _reach(
    structure: PolynomialStructure,
    theta: Array,
    plain: Array,
    letter: str,
    errors: float | None = None,
) -> float:
    """How far the real roots of C or D may lie from zero."""
    places = np.flatnonzero([name[0] == letter for name in structure.names])
    polynomial = np.concatenate([[1.0], theta[places]])
    return farthest(polynomial, plain[np.ix_(places, places)], errors)


def _fits_elsewhere(found: SearchResult) -> bool:
    """Whether another minimum, many bars away, fits as well within chance.

    Likelihoods are those with the colour taken out, or follow from the sums of squares; colour
    leaves fewer samples.
    """
    best, *others = found.minima
    if found.covariance is None or not best.objective > 0.0:
        return False
    bars = np.sqrt(np.diag(found.covariance))
    samples = found.degrees / max(found.colour[1], 1.0) ** 2
    behind = found.behind[1:] or [
        samples * np.log(each.objective / best.objective) for each in others
    ]
    return any(
        gap < scipy.special.chdtri(1, ALIKE)
        and np.max(np.abs(np.array(list(each.values.values())) - found.theta) / bars) > FAR
        for each, gap in zip(others, behind, strict=True)
    )


def widened(found: SearchResult, times: float) -> SearchResult:
    """The same with standard errors so many times as long."""
    known = found.covariance
    return found if known is None else replace(found, covariance=times**2 * known)


def _tells_nothing(data: SampledChannels, errors: Array, plain: Array) -> bool:
    """Whether inputs explain no more of the output than chance does."""
    about = [data.output[span] - data.output[span].mean() for span in data.spans]
    gain = likelihood_gain(about, [errors[span] for span in data.spans], chance_share)
    return gain < least_gain(len(plain))


def _ratio(data: SampledChannels, errors: Array) -> float:
    """Size of the errors over that of the output about its means."""
    about = np.concatenate([data.output[span] - data.output[span].mean() for span in data.spans])
    return float(np.sqrt(errors @ errors / max(about @ about, np.finfo(float).tiny)))


def judged_tests(
    tests: InnovationTests, data: SampledChannels, found: SearchResult, errors: Array
) -> InnovationTests:
    """The tests as they count: by the fit's own projection where errors are coloured."""
    ratio, spans = _ratio(data, errors), data.spans
    seen = found.correlations if ratio > ROUNDING else ()
    made = tests.fitted(seen, [ratio]).beside(found.agreement)
    told = independent_samples([errors[span] for span in spans])
    return replace(made, slow=told) if told < SLOW * errors.size else made


def _by_colour(
    structure: PolynomialStructure,
    data: SampledChannels,
    found: SearchResult,
    errors: Array,
    blocks: Sequence[RecordBlock] | None,
) -> SearchResult:
    """The vehicle's coefficients by the colour of the noise, where it has its own poles.

    What white errors would give for known C and D makes room for it; what a loop adds stays.
    Errors that are not white come with their blocks, and are tested against the inputs.

    Reference: Ljung, *System Identification*, 2nd ed., theorem 8.4 and eq. 9.42.
    """
    places = np.array([name[0] in "bf" for name in structure.names])
    if found.covariance is None or not places.any():
        return found
    known = output_error_covariance(structure, data, found.theta, errors, found.skip)
    block = np.ix_(places, places)
    covariance, freedom = found.covariance.copy(), np.full(places.size, float(found.degrees))
    across = covariance[np.ix_(~places, places)]
    # As if C and D were known; what they share may be singular where a root of both cancels.
    noise = np.linalg.pinv(covariance[np.ix_(~places, ~places)], hermitian=True)
    apart = covariance[block] - across.T @ noise @ across
    covariance[block] += known.covariance - apart
    freedom[places] = known.freedom
    of_noise = np.ix_(~places, ~places)
    columns = answers(structure, data, found.theta, errors, found.skip)
    bias = noise_bias(structure, found.theta, columns, covariance[of_noise])
    covariance[of_noise] += np.outer(bias, bias)
    found = replace(found, covariance=covariance, freedom=freedom, agreement=known.agreement)
    if blocks is None:
        return found
    of_vehicle = [
        RecordBlock.of(
            each.projected.reshape(*each.residual.shape, -1)[:, :, places],
            np.zeros((*each.residual.shape, 0)),
            each.residual,
        )
        for each in blocks
    ]
    inputs = [data.inputs[:, span][:, found.skip :] for span in data.spans]
    white = residual_covariance(of_vehicle, inputs=inputs)
    return replace(
        found,
        colour=white.colour,
        correlations=white.correlations,
        noise_reason=NOISE_MODEL,
    )


def printed(covariance: Array | None, parameters: Mapping[str, Estimate]) -> Array | None:
    """Covariance of the coefficients that have intervals."""
    if covariance is None:
        return None
    shown = [each.stderr is not None for each in parameters.values()]
    return covariance[np.ix_(shown, shown)] if any(shown) else None
