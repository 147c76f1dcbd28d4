"""Whether prediction errors are what intervals of a black box assume: white, and new to the inputs.

Where the errors of a model whose noise shares its poles are not white, its estimates are biased;
where inputs still foretell the errors, dynamics are missing. A part m of the errors that should not
be there moves estimates, in units of their standard errors s, by no more than |m|/s in any
direction; a portmanteau tells |m|²/s² beside chance, of what the fit left of it. Bars longer by as
much hold the bias of coloured errors. Missing dynamics keep their sign over a band and move
estimates further, so there are no bars where inputs tell more than chance does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.uncertainty.agreement import Agreement
from flightid.uncertainty.fitted_correlation import FittedCorrelation
from flightid.uncertainty.foretold import (
    is_material,
    percent_of_output,
    share_from_inputs,
    share_from_past,
)
from flightid.uncertainty.residual_correlation import (
    Series,
    autocorrelation,
    cross_correlation,
    independence_portmanteau,
    lag_covariance,
    white_portmanteau,
)

Array = NDArray[np.float64]
ALIKE = 1.05
"""Ratio of bars that is not worth a word."""
IN_DOUBT = "errors-in-doubt"
"""Code of errors of few samples that may not be white."""
MORE_SAMPLES = "fly longer, or compare output error of the same order"
INPUTS_IN_ERRORS = "inputs-in-errors"
"""Code of errors that inputs foretell."""
FALSE_ALARMS = 0.01
"""Share of good models that each of both tests calls wrong."""
DOUBT = 0.1
"""Chance of white errors below which bars of few samples hold what colour would bias: in 150 of
noise of another colour a fifteenth of flights lies between, and 15 % of good models."""
LAGS = 25
FEWEST_LAGS = 5
"""Beyond the parameters that were fitted: below it there is no test."""
ROUNDING = 1e-8
"""Errors over outputs below which there is rounding alone."""
NOISE_MODEL = (
    "fit a noise model beside the vehicle (Box-Jenkins): it tells slow noise from missing dynamics"
)
ORDERS = "raise the orders of the input's part, check its delay, or look for feedback"
WIDEST = 10.0
"""Times a standard error by which a bias may widen it before there is none."""
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class InnovationTests:
    """Smallest p-values over outputs and inputs, by the number of tests; None: not testable.

    Attributes
    ----------
    white : float or None
        That the errors do not foretell themselves.
    independent : float or None
        That past inputs do not foretell the errors.
    worth_percent : float or None
        Most of an output that an input still foretells, rms in percent of the output's.
    past_percent : float or None
        The same of the errors' own past.
    excess : tuple of float
        By how much the statistics of whiteness and of independence exceed their mean by chance,
        summed over outputs and inputs: squared size, in standard deviations of the errors, of what
        should not be there.
    slow : float or None
        Independent samples that errors amount to, where they are so few that slow noise alone
        seems to follow the inputs.
    cause : str
        Why inputs foretell errors, where they do.
    is_short : bool
        Whether samples are so few that colour which bends estimates may not show.
    """

    white: float | None
    independent: float | None
    worth_percent: float | None = None
    past_percent: float | None = None
    excess: tuple[float, float] = (0.0, 0.0)
    slow: float | None = None
    cause: str = "dynamics are missing"
    is_short: bool = False

    @property
    def is_white(self) -> bool:
        """Whether nothing speaks against white errors."""
        return self.white is None or self.white >= FALSE_ALARMS

    @property
    def is_doubted(self) -> bool:
        """Whether few samples leave white errors in doubt, short of speaking against them."""
        in_doubt = self.white is not None and self.white < DOUBT
        return self.is_short and self.is_white and in_doubt

    @property
    def is_independent(self) -> bool:
        """Whether nothing speaks against errors that are new to the inputs."""
        return self.independent is None or self.independent >= FALSE_ALARMS

    @property
    def why_biased(self) -> str:
        """Why estimates whose noise and vehicle share poles are biased; empty where they are not.

        Example
        -------
        >>> InnovationTests(1e-9, 0.5).why_biased
        'prediction errors are not white (p = 1e-09), which biases the estimates'
        """
        if not self.is_independent:
            worth = self.worth_percent
            if worth == 0.0:
                return (
                    f"inputs seem to foretell the prediction errors (p = {self.independent:.2g}), "
                    "though by nothing that can be told from chance"
                )
            if self.slow is not None:
                return (
                    f"inputs seem to foretell the prediction errors (p = {self.independent:.2g}), "
                    f"which are so slow (worth {self.slow:.2g} independent samples) that missing "
                    "dynamics cannot be told from noise"
                )
            size = "" if worth is None else f", worth {worth:.2g} % of the output"
            return (
                f"inputs still foretell the prediction errors (p = {self.independent:.2g}{size}): "
                f"{self.cause}, and the estimates are biased"
            )
        if not self.is_white:
            chance = f"(p = {self.white:.2g})"
            return f"prediction errors are not white {chance}, which biases the estimates"
        return ""

    def widening(self, *, biased: bool) -> float | None:
        """Times by which standard errors have to be longer to hold a bias; None: no bars hold it.

        `biased` says whether coloured errors bias estimates of this structure.

        Example
        -------
        >>> InnovationTests(1e-3, 0.5, 0.0, 0.2, (24.0, 0.0)).widening(biased=True)
        5.0
        """
        size, material = 1.0, False
        if biased and (self.is_doubted or not self.is_white):
            size += self.excess[0]
            material = not self.is_white and is_material(self.past_percent)
        if not self.is_independent:
            size += self.excess[1]
            material = material or self.worth_percent != 0.0
        return None if material or size > WIDEST**2 else math.sqrt(size)

    def fitted(
        self, correlations: Sequence[FittedCorrelation], ratios: Sequence[float]
    ) -> InnovationTests:
        """Inputs tested by what the fit leaves; `ratios` are residuals over outputs, by output.

        As they are where there are no such correlations.
        """
        if not correlations:
            return self
        worth = [
            percent_of_output(each.share, ratios[each.output], 1.0) or 0.0 for each in correlations
        ]
        chance = min(1.0, len(correlations) * min(each.p_value for each in correlations))
        return replace(self, independent=chance, worth_percent=max(worth))

    def beside(self, agreement: Agreement | None) -> InnovationTests:
        """The tests of a mean vehicle: where records differ, inputs tell how; scatter counts."""
        if agreement is None or agreement.freedom is None:
            return self
        return replace(self, independent=None)

    def findings(
        self, *, biased: bool, action: str = ORDERS, times: float | None = None
    ) -> list[Finding]:
        """Verdicts; `biased` says whether coloured errors bias estimates of this structure.

        `action` is what to do where inputs foretell the errors, `times` how much longer standard
        errors were made to hold a bias.
        """
        bars = "they have no intervals"
        if times is not None:
            longer = f"{times:.2g} times as long, to hold"
            bars = (
                f"intervals {f'are {longer}' if times > ALIKE else 'are long enough to hold'} that"
            )
        if not self.is_independent:
            light = Light.RED if is_material(self.worth_percent) else Light.AMBER
            words = self.why_biased if times is None else f"{self.why_biased}; {bars}"
            action = action if self.slow is None else NOISE_MODEL
            return [Finding(INPUTS_IN_ERRORS, light, words, action)]
        if self.is_doubted and biased and times is not None:
            said = f"prediction errors may not be white (p = {self.white:.2g}); {bars}"
            return [Finding(IN_DOUBT, Light.GREEN, said, MORE_SAMPLES)]
        if self.is_white or not biased:
            return []
        return [
            Finding(
                "errors-not-white",
                Light.AMBER,
                f"{self.why_biased}; {bars}",
                "fit a noise model that is large enough, or one that shares no poles with the "
                "vehicle (output error, Box-Jenkins; method='iv4' for ARX)",
            )
        ]


def innovation_tests(
    errors: Sequence[Array],
    inputs: Sequence[Array],
    outputs: Sequence[Array],
    spent: tuple[int, int],
) -> InnovationTests:
    """Test prediction errors against their own past and that of the inputs.

    Parameters
    ----------
    errors, outputs : sequence of ndarray, shape (n_outputs, n_samples)
        One array for each record.
    inputs : sequence of ndarray, shape (n_inputs, n_samples)
    spent : tuple of int
        Parameters that shape the errors' correlation with themselves, and with an input.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 16.6; Ljung & Box (1978), Biometrika 65(2).

    Example
    -------
    >>> e, u = np.random.default_rng(1).standard_normal((2, 1, 500))
    >>> innovation_tests([e], [u], [e + u], (0, 0)).why_biased
    ''
    """
    shortest = min(row.shape[1] for row in errors)
    n, first = sum(row.shape[1] for row in errors), max(spent) + FEWEST_LAGS
    lags = min(LAGS + max(spent), shortest // 4)
    if lags < first:
        return InnovationTests(None, None)
    own: list[tuple[float, float, float]] = []
    driven: list[tuple[float, float, float]] = []
    for place in range(len(errors[0])):
        e = tuple(row[place] for row in errors)
        ratio = _size(e) / max(_size(tuple(row[place] for row in outputs)), TINY)
        if ratio <= ROUNDING:
            continue
        past = cross_correlation(e, e, lags)[lags + 1 :]
        statistic, degrees, p_value = white_portmanteau(past, n, spent[0])
        share = share_from_past(past, n)
        own.append((p_value, percent_of_output(share, ratio, 1.0) or 0.0, statistic - degrees))
        for channel in range(len(inputs[0])):
            u = tuple(row[channel] for row in inputs)
            if _size(u) > 0.0:
                driven += _independence(u, e, lags, spent[1], ratio)
    (white, past_percent, old), (independent, worth, new) = _joined(own), _joined(driven)
    return InnovationTests(white, independent, worth, past_percent, (old, new))


def _independence(
    u: Series, e: Series, lags: int, spent: int, ratio: float
) -> list[tuple[float, float, float]]:
    """Chance, worth in percent of the output, and excess; empty where there is no test."""
    n = sum(row.size for row in e)
    values = cross_correlation(u, e, lags)[lags:]
    covariance = lag_covariance(u, e, lags + 1)
    statistic, degrees, p_value = independence_portmanteau(values, covariance, n, spent)
    share = share_from_inputs(values, autocorrelation(u, lags + 1), covariance, n)
    worth = percent_of_output(share, ratio, 1.0) or 0.0
    return [(p_value, worth, statistic - degrees)] if degrees >= 1 else []


def _size(series: Series) -> float:
    whole = np.concatenate([row - row.mean() for row in series])
    return float(np.sqrt(np.mean(whole**2)))


def _joined(
    found: Sequence[tuple[float, float, float]],
) -> tuple[float | None, float | None, float]:
    """Bonferroni's p-value of several tests, the largest worth, and the excess of all."""
    if not found:
        return None, None, 0.0
    chances, worths, excesses = zip(*found, strict=True)
    return min(1.0, len(found) * min(chances)), max(worths), sum(max(e, 0.0) for e in excesses)
