"""All correlation tests of a set of residuals."""

from __future__ import annotations

from flightid.errors import UnknownNameError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.feedback_result import FeedbackTest
from flightid.validation.residuals.correlation_result import (
    CorrelationTest,
    Horizon,
    Kind,
    Loop,
    Verdict,
)

RULE = (
    "Pass: portmanteau p at least 0.05, or no more lags outside the pointwise 95 % band than "
    "chance explains and none outside the simultaneous band."
)


@dataclass(frozen=True, eq=False, repr=False)
class ResidualTests(Result, schema="flightid.residual_tests/1"):
    """Whether residuals are unpredictable from inputs and from their own past.

    Attributes
    ----------
    inputs, outputs : tuple of str
        Channels.
    tests : tuple of CorrelationTest
        By output: whiteness, then the functions of each input.
    horizon : Horizon
        Which predictor made the residuals.
    predictor : str
        The same in one sentence, with what was solved for.
    loop : Loop
        Whether residuals reach the inputs.
    maximum_lag : int
        Largest lag, samples.
    n_samples, n_records : int
        Samples of all records, and their number.
    fitted_noise, fitted_input : int
        Parameters fitted to these samples, taken off the degrees of freedom.
    findings : tuple of Finding
        Verdicts.
    feedback : FeedbackTest
        How the loop is known: declared or tested.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> rng = np.random.default_rng(3)
    >>> u, e = rng.uniform(-1, 1, 1000), rng.standard_normal(1000)
    >>> fid.residual_tests(e, u, horizon="one step ahead")
    ResidualTests(1 output, 1 input, 1000 samples, 5 of 5 tests passed)
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    tests: tuple[CorrelationTest, ...]
    horizon: Horizon
    predictor: str
    loop: Loop
    maximum_lag: int
    n_samples: int
    n_records: int
    fitted_noise: int
    fitted_input: int
    findings: tuple[Finding, ...]
    feedback: FeedbackTest

    def test(self, kind: Kind | str, output: str, input: str | None = None) -> CorrelationTest:
        """One test by its function and channels.

        Raises
        ------
        UnknownNameError
            There is no such test.
        """
        for item in self.tests:
            if (item.kind, item.output, item.input) == (kind, output, input):
                return item
        raise UnknownNameError(
            "there is no such test",
            found=f"{kind}: {output}, {input}",
            needed="; ".join(item.name for item in self.tests),
        )

    def counted(self, verdict: Verdict) -> tuple[CorrelationTest, ...]:
        """Tests that count and have this verdict."""
        return tuple(item for item in self.tests if item.counts and item.verdict is verdict)

    def summary(self) -> Table:
        """Table by test, with the predictor, the rule and the verdicts below."""
        columns = (
            Column("test"),
            Column("output"),
            Column("input"),
            Column("verdict"),
            Column("counts"),
            Column("p", digits=3),
            Column("degrees of freedom"),
            Column("lags outside"),
            Column("at most"),
            Column("largest", digits=3),
            Column("pointwise band", digits=3),
            Column("simultaneous band", digits=3),
        )
        rows: list[tuple[Cell, ...]] = [
            (
                str(item.kind),
                item.output,
                item.input,
                str(item.verdict),
                item.counts and item.verdict is not Verdict.NOT_TESTABLE,
                item.p_value,
                item.degrees_of_freedom,
                item.exceedances,
                item.exceedance_limit,
                item.largest,
                item.pointwise_band,
                item.simultaneous_band,
            )
            for item in self.tests
        ]
        lags = f"Lags to {self.maximum_lag} samples; {self.feedback}."
        reasons = dict.fromkeys(
            f"{item.kind}: {item.reason}." for item in self.tests if item.reason
        )
        notes = (self.predictor, lags, RULE, *reasons, *map(str, self.findings))
        return Table(repr(self), columns, tuple(rows), notes)

    def _computed(self) -> dict[str, object]:
        return {"rule": RULE}

    def __repr__(self) -> str:
        """Size, and how many of the tests that count and could be made have passed."""
        passed = len(self.counted(Verdict.PASS))
        made = passed + len(self.counted(Verdict.FAIL))
        outputs = f"{len(self.outputs)} output" + "s" * (len(self.outputs) != 1)
        inputs = f"{len(self.inputs)} input" + "s" * (len(self.inputs) != 1)
        return (
            f"ResidualTests({outputs}, {inputs}, {self.n_samples} samples, "
            f"{passed} of {made} tests passed)"
        )
