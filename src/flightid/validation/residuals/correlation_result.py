"""One correlation test of residuals: its values, bands, statistic and verdict."""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.surface import spoken
from flightid.uncertainty.residual_correlation import LEVEL


class Kind(StrEnum):
    """Which correlation function: linear whiteness and independence, then Billings and Voon's.

    `CROSS` asks whether the past of another output's residual foretells this one.

    Example
    -------
    >>> Kind("u²ε").name
    'EVEN'
    """

    WHITENESS = "εε"
    INDEPENDENCE = "uε"
    EVEN = "u²ε"
    EVEN_SQUARED = "u²ε²"
    BILINEAR = "ε(εu)"
    CROSS = "ε′ε"


class Horizon(StrEnum):
    """Which predictor the residuals come from; only one step ahead promises white ones.

    Example
    -------
    >>> Horizon("free run").name
    'FREE_RUN'
    """

    ONE_STEP = "one step ahead"
    FREE_RUN = "free run"


class Loop(StrEnum):
    """Whether residuals reach the inputs: with a closed loop only past inputs are judged.

    `CLOSED` judges lags from zero. `CLOSED_WITHIN_SAMPLE` judges lags from one: where u(t) is
    computed from y(t), the two share the residual at lag zero, whatever the model.

    Example
    -------
    >>> Loop("closed").name
    'CLOSED'
    """

    OPEN = "open"
    CLOSED = "closed"
    CLOSED_WITHIN_SAMPLE = "closed within the sample"


class Verdict(StrEnum):
    """Outcome of a test.

    Example
    -------
    >>> Verdict("not testable").name
    'NOT_TESTABLE'
    """

    PASS = "pass"
    FAIL = "fail"
    NOT_TESTABLE = "not testable"


NEEDS_ONE_STEP = frozenset({Kind.WHITENESS, Kind.BILINEAR, Kind.CROSS})
"""Tests that presume white residuals, which no free run promises."""


@dataclass(frozen=True, eq=False, repr=False)
class CorrelationTest:
    """One normalised correlation function, judged.

    A test passes where the portmanteau p-value is at least 0.05, or where no more lags leave the
    pointwise band than chance explains and none leaves the simultaneous band. The second half
    forgives a marginal p-value; without its last clause one lag however large would be forgiven.

    Attributes
    ----------
    kind : Kind
        Correlation function.
    output : str
        Output whose residual is tested.
    input : str or None
        Input it is tested against; None for whiteness, another output for `CROSS`.
    verdict : Verdict
        Outcome.
    counts : bool
        Whether a good model must pass it; False for whiteness of a free run.
    reason : str
        Why it is not testable or does not count; empty otherwise.
    lags : ndarray of int, shape (n_lags,)
        Samples by which the first factor leads; empty where it is not testable.
    values : ndarray, shape (n_lags,)
        Normalised correlations.
    judged : ndarray of bool, shape (n_lags,)
        Lags that the verdict rests on.
    standard_error : float
        Of one value for a good model, Bartlett's where input or residual are coloured.
    white_band : float
        z(0.975)/√N, the 95 % band for a white residual.
    pointwise_band, simultaneous_band : float
        Half-widths that hold one lag, and all judged lags, in 95 % of cases.
    statistic : float
        Portmanteau statistic over the judged lags.
    degrees_of_freedom : int
        Of the statistic, less the parameters that were fitted to these samples.
    p_value : float
        Chance of a statistic as large for a good model.
    exceedances, exceedance_limit : int
        Judged lags outside the pointwise band, and how many chance explains in 95 % of cases.
    worth_percent : float or None
        Root mean square of the residual that the judged lags foretell, beyond chance, in percent
        of the output's; None where the output is not known.

    Example
    -------
    >>> import flightid as fid
    >>> rng = np.random.default_rng(3)
    >>> u, e = rng.uniform(-1, 1, 1000), rng.standard_normal(1000)
    >>> tests = fid.residual_tests(e, u, horizon="one step ahead")
    >>> tests.test("uε", "e1", "u1").verdict.value
    'pass'
    """

    kind: Kind
    output: str
    input: str | None
    verdict: Verdict
    counts: bool
    reason: str
    lags: NDArray[np.int64]
    values: NDArray[np.float64]
    judged: NDArray[np.bool_]
    standard_error: float | None = None
    white_band: float | None = None
    pointwise_band: float | None = None
    simultaneous_band: float | None = None
    statistic: float | None = None
    degrees_of_freedom: int | None = None
    p_value: float | None = None
    exceedances: int | None = None
    exceedance_limit: int | None = None
    worth_percent: float | None = None

    @property
    def name(self) -> str:
        """Function and channels, for example ``"uε: p, tau"``."""
        channels = self.output if self.input is None else f"{self.output}, {self.input}"
        return f"{self.kind}: {channels}"

    @property
    def largest(self) -> float | None:
        """Largest judged correlation by size, sign kept; None where it is not testable."""
        if self.verdict is Verdict.NOT_TESTABLE:
            return None
        judged = self.values[self.judged]
        return float(judged[np.argmax(np.abs(judged))])

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "kind": str(self.kind),
            "output": self.output,
            "input": self.input,
            "verdict": str(self.verdict),
            "counts": self.counts,
            "reason": self.reason,
            "lags": self.lags.tolist(),
            "values": self.values.tolist(),
            "judged": self.judged.tolist(),
            "standard_error": self.standard_error,
            "white_band": self.white_band,
            "pointwise_band": self.pointwise_band,
            "simultaneous_band": self.simultaneous_band,
            "statistic": self.statistic,
            "degrees_of_freedom": self.degrees_of_freedom,
            "p_value": self.p_value,
            "exceedances": self.exceedances,
            "exceedance_limit": self.exceedance_limit,
            "worth_percent": self.worth_percent,
        }

    def __repr__(self) -> str:
        """Channels, verdict and p-value on one line."""
        worth = "" if self.p_value is None else spoken(f", p = {self.p_value:.3g}")
        return f"CorrelationTest({self.name}: {self.verdict}{worth})"


def passes(p_value: float, exceedances: int, limit: int, *, all_inside: bool) -> bool:
    """The pass rule of `CorrelationTest`.

    Example
    -------
    >>> passes(0.01, 2, 3, all_inside=True), passes(0.01, 1, 3, all_inside=False)
    (True, False)
    """
    return p_value >= 1.0 - LEVEL or (exceedances <= limit and all_inside)
