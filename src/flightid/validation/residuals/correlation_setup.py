"""Correlation functions of one set of residuals and inputs, judged kind by kind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.fitted_correlation import FittedCorrelation
from flightid.uncertainty.foretold import (
    percent_of_output,
    share_from_inputs,
    share_from_past,
    share_of_lags,
)
from flightid.uncertainty.quantiles import normal_quantiles
from flightid.uncertainty.residual_correlation import (
    Series,
    autocorrelation,
    centred,
    cross_correlation,
    exceedance_limit,
    independence_portmanteau,
    lag_covariance,
    pointwise_factor,
    simultaneous_factor,
    white_portmanteau,
)
from flightid.validation.residuals.correlation_result import (
    NEEDS_ONE_STEP,
    CorrelationTest,
    Horizon,
    Kind,
    Loop,
    Verdict,
    passes,
)
from flightid.validation.residuals.data import ResidualData
from flightid.validation.residuals.obstacles import obstacle

FIRST_JUDGED_LAG = {Loop.CLOSED: 0, Loop.CLOSED_WITHIN_SAMPLE: 1}


@dataclass(frozen=True)
class CorrelationSetup:
    """What every test of one call shares.

    Attributes
    ----------
    data : ResidualData
    loop : Loop
    maximum_lag : int
        Samples.
    fitted_noise, fitted_input : int
        Parameters that were fitted to these samples.
    """

    data: ResidualData
    loop: Loop
    maximum_lag: int
    fitted_noise: int
    fitted_input: int

    @property
    def n_samples(self) -> int:
        """Of all records together."""
        return sum(self.data.lengths)

    @property
    def first_judged(self) -> int:
        """First lag that counts: residuals reach the inputs of a closed loop."""
        return FIRST_JUDGED_LAG.get(self.loop, -self.maximum_lag)

    def test(self, kind: Kind, output: str, name: str | None) -> CorrelationTest:
        """One test, or why it cannot be made."""
        e = self.data.residuals[output]
        group = self.data.residuals if kind is Kind.CROSS else self.data.inputs
        u = e if name is None else group[name]
        counts = self.data.horizon is Horizon.ONE_STEP or kind not in NEEDS_ONE_STEP
        scale = self.data.scale.get(output, 0.0)
        open_loop = self.data.horizon is not Horizon.FREE_RUN or self.loop is Loop.OPEN
        reason = obstacle(kind, e, u, scale=scale, open_loop=open_loop)
        if reason:
            return _not_testable(kind, output, name, counts, reason)
        note = "" if counts else "a free run need not leave white residuals; shown, not counted"
        if kind in NEEDS_ONE_STEP:
            return self._white(kind, output, name, counts, note)
        return self._independent(kind, output, name, note)

    def _white(
        self, kind: Kind, output: str, name: str | None, counts: bool, note: str
    ) -> CorrelationTest:
        """Whiteness, φ_ε′ε and φ_ε(εu): successive lags are independent for a good model."""
        e = self.data.residuals[output]
        lags = np.arange(1, self.maximum_lag + 1)
        first, fitted = e, self.fitted_noise
        if kind is Kind.CROSS:
            first, fitted = self.data.residuals[name or ""], 0
        elif name is not None:
            # φ_ε(εu)(τ) pairs ε(t) with the product at t − 1 − τ: lag τ + 1 of the product.
            lags, fitted = np.arange(self.maximum_lag + 1), 0
            u = centred(self.data.inputs[name])
            first = tuple(x * y for x, y in zip(centred(e), u, strict=True))
        every = cross_correlation(first, e, self.maximum_lag + 1)
        # Lag one stands there for φ_ε(εu)'s τ = 0 too.
        values = every[self.maximum_lag + 2 :][: lags.size]
        measures = white_portmanteau(values, self.n_samples, fitted)
        judged = np.ones(lags.size, dtype=np.bool_)
        share = (share_from_past if kind is Kind.WHITENESS else share_of_lags)(
            values, self.n_samples
        )
        return self._judged(
            _CorrelationValues(kind, output, name, counts, note, lags, values, judged, share),
            1.0,
            measures,
        )

    def _independent(self, kind: Kind, output: str, name: str | None, note: str) -> CorrelationTest:
        e = self.data.residuals[output]
        u = self.data.inputs[name or ""]
        a = u if kind is Kind.INDEPENDENCE else _squared(u)
        b = _power_scores(e) if kind is Kind.EVEN_SQUARED else e
        known = self.data.fitted.get((output, name or ""))
        if kind is Kind.INDEPENDENCE and known is not None and self.loop is Loop.OPEN:
            return self._fitted(known, output, name, note)
        lags = np.arange(-self.maximum_lag, self.maximum_lag + 1)
        values = cross_correlation(a, b, self.maximum_lag)
        judged = lags >= self.first_judged
        covariance = lag_covariance(a, b, lags.size)
        fitted = self.fitted_input if kind is Kind.INDEPENDENCE else 0
        measures = independence_portmanteau(values[judged], covariance, self.n_samples, fitted)
        if measures[1] < 1:
            reason = "the input's band is too narrow for so many fitted parameters; use more lags"
            return _not_testable(kind, output, name, True, reason)
        own = autocorrelation(a, lags.size)
        share = share_from_inputs(values[judged], own, covariance, self.n_samples)
        found = _CorrelationValues(kind, output, name, True, note, lags, values, judged, share)
        return self._judged(found, float(covariance[0]), measures)

    def _fitted(
        self, known: FittedCorrelation, output: str, name: str | None, note: str
    ) -> CorrelationTest:
        """By the covariance that the fit's own projection gives; one band, of its mean error."""
        judged = np.ones(known.lags.size, dtype=np.bool_)
        values = _CorrelationValues(
            Kind.INDEPENDENCE,
            output,
            name,
            True,
            note,
            known.lags,
            known.values,
            judged,
            known.share,
        )
        variance = self.n_samples * float(np.mean(known.errors**2))
        measures = (known.statistic, known.degrees, known.p_value)
        return self._judged(values, variance, measures, errors=known.errors)

    def _judged(
        self,
        found: _CorrelationValues,
        variance: float,
        measures: tuple[float, int, float],
        errors: NDArray[np.float64] | None = None,
    ) -> CorrelationTest:
        error = float(np.sqrt(max(variance, 0.0) / self.n_samples))
        each = np.full(int(np.sum(found.judged)), error) if errors is None else errors
        sizes = np.abs(found.values[found.judged])
        pointwise, whole = pointwise_factor(), simultaneous_factor(sizes.size)
        outside = int(np.count_nonzero(sizes > pointwise * each))
        limit = exceedance_limit(sizes.size)
        statistic, degrees, p_value = measures
        inside = bool(np.all(sizes <= whole * each))
        good = passes(p_value, outside, limit, all_inside=inside)
        return CorrelationTest(
            found.kind,
            found.output,
            found.input,
            Verdict.PASS if good else Verdict.FAIL,
            found.counts,
            found.note,
            found.lags,
            found.values,
            found.judged,
            error,
            pointwise / float(np.sqrt(self.n_samples)),
            pointwise * error,
            whole * error,
            statistic,
            degrees,
            p_value,
            outside,
            limit,
            self._worth(found.output, found.share),
        )

    def _worth(self, output: str, share: float) -> float | None:
        size = float(np.std(np.concatenate(centred(self.data.residuals[output]))))
        return percent_of_output(share, size, self.data.scale.get(output, 0.0))


@dataclass(frozen=True)
class _CorrelationValues:
    kind: Kind
    output: str
    input: str | None
    counts: bool
    note: str
    lags: NDArray[np.int64]
    values: NDArray[np.float64]
    judged: NDArray[np.bool_]
    share: float


def _squared(series: Series) -> Series:
    return tuple(record**2 for record in centred(series))


def _power_scores(series: Series) -> Series:
    """Normal scores of ε²: its rank among all, as a quantile of the normal distribution.

    A short manoeuvre weighs few samples, and sums of a few squares have a longer tail than the
    chi-square of a correlation knows: 17 of 1,000 doublets beside white noise failed at 1 of 1,000.

    Reference
    ---------
    van der Waerden (1952), Indagationes Mathematicae 14.

    Example
    -------
    >>> [row.round(2).tolist() for row in _power_scores((np.array([0.0, 1.0, -3.0, 2.0]),))]
    [[-0.84, -0.25, 0.84, 0.25]]
    """
    squares = _squared(series)
    whole = np.concatenate(squares)
    _, place, count = np.unique(whole, return_inverse=True, return_counts=True)
    middle = np.cumsum(count) - 0.5 * (count - 1.0)
    scores = normal_quantiles(middle[place] / (whole.size + 1.0))
    return tuple(np.split(scores, np.cumsum([each.size for each in squares])[:-1]))


def _not_testable(
    kind: Kind, output: str, name: str | None, counts: bool, reason: str
) -> CorrelationTest:
    nothing = np.empty(0)
    return CorrelationTest(
        kind, output, name, Verdict.NOT_TESTABLE, counts, reason,
        nothing.astype(np.int64), nothing, nothing.astype(np.bool_),
    )  # fmt: skip
