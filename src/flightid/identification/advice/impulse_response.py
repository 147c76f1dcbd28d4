"""Pulse and step responses with intervals, straight from records, no order assumed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, OptionError
from flightid.evidence import FeedbackTest, feedback_test
from flightid.frozen import dataclass
from flightid.identification.advice.delays import InputDelay, find_delays
from flightid.identification.advice.vanishing_tail import vanishes
from flightid.identification.prediction_error.kernel_regression import kernel_estimate
from flightid.identification.prediction_error.linear_regression import (
    LinearRegression,
    inverse_square,
    regress,
    regress_lags,
)
from flightid.models.polynomial.structure import KERNELS
from flightid.models.sampled.channels import SampledChannels, gather_channels
from flightid.record import Record
from flightid.record.hold import Loop
from flightid.record.several import as_records
from flightid.recursive_filter import filtered
from flightid.result import Result
from flightid.table import Column, Table
from flightid.uncertainty.feedback_result import unless_logged
from flightid.uncertainty.quantiles import half_width

Array = NDArray[np.float64]
WHITENER = 20
SAMPLES_PER_COEFFICIENT = 3
LAST = 4
"""One over the share of the lags, at their end, that has to be zero."""
OUTLASTS = (
    "the response outlasts {} lags, the most that the records allow, which bends all of them: no "
    "intervals; give longer records, or fit a model with poles (output error)"
)


@dataclass(frozen=True, eq=False, repr=False)
class ImpulseResponse(
    Result, schema="flightid.impulse_response/1", untold={"channels": "time histories"}
):
    """Response of one output to a pulse of one sample on each input.

    Attributes
    ----------
    inputs : tuple of str
    output : str
    lags : ndarray of int, shape (n_lags,)
        Samples after the pulse; negative ones are the response before it, which only feedback has.
    values : ndarray, shape (n_inputs, n_lags)
        In the output's unit per the input's.
    covariance : ndarray, shape (n_inputs, n_lags, n_lags), or None
        None where the response outlasts all lags that the records allow; see `reason`.
    sample_time_s : float
    kernel : str or None
        Regularisation.
    n_samples : int
        Samples that were fitted.
    channels : SampledChannels
        What was fitted, means removed: delays are told from it when they are first asked for.
    units : mapping of str to str
    fitted_lags : int
        Lags that were fitted: more than those asked for, where the response outlasts them.
    reason : str
        Why there is no covariance; else empty.
    feedback : FeedbackTest
        Whether a loop was closed: along one no delay is told.

    Example
    -------
    >>> ImpulseResponse.__name__
    'ImpulseResponse'
    """

    inputs: tuple[str, ...]
    output: str
    lags: NDArray[np.int64]
    values: Array
    covariance: Array | None
    sample_time_s: float
    kernel: str | None
    n_samples: int
    channels: SampledChannels
    units: Mapping[str, str] = field(default_factory=dict)
    fitted_lags: int = 0
    reason: str = ""
    feedback: FeedbackTest = FeedbackTest("unknown", "too short")

    @cached_property
    def acts_after(self) -> dict[str, InputDelay]:
        """Samples until each input acts, from structures with every delay; untold in a loop.

        There an answer within a sample is the controller's, turned round.
        """
        if self.feedback.may_turn_round:
            return dict.fromkeys(self.inputs, InputDelay())
        longest = max(int(self.lags[-1]), 0)
        return dict(zip(self.inputs, find_delays(self.channels, longest), strict=True))

    @property
    def delays(self) -> dict[str, int | None]:
        """Samples until each input acts; None where no effect stands out, or it is too unsure."""
        return {name: each.samples for name, each in self.acts_after.items()}

    @property
    def time_s(self) -> Array:
        """Lags in seconds, shape (n_lags,)."""
        return np.asarray(self.lags * self.sample_time_s)

    @property
    def stderr(self) -> Array | None:
        """Standard errors of `values`, shape (n_inputs, n_lags)."""
        if self.covariance is None:
            return None
        return np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))

    def step(self) -> tuple[Array, Array | None]:
        """Step response from lag 0 on and its standard errors, shapes (n_inputs, n_lags ≥ 0)."""
        causal = self.lags >= 0
        total = np.tril(np.ones((int(np.sum(causal)),) * 2))
        values = self.values[:, causal] @ total.T
        if self.covariance is None:
            return values, None
        parts = self.covariance[:, causal][:, :, causal]
        variance = np.diagonal(total @ parts @ total.T, axis1=1, axis2=2)
        return values, np.sqrt(np.maximum(variance, 0.0))

    def summary(self) -> Table:
        """Table by input: delay, largest response, final step value."""
        columns = (
            Column("input"),
            Column("delay", "samples"),
            Column("delay", "s"),
            Column("largest"),
            Column("at", "s"),
            Column("step at the end"),
            Column("± step"),
        )
        steps, errors = self.step()
        rows = []
        for i, name in enumerate(self.inputs):
            delay = self.delays[name]
            peak = int(np.argmax(np.abs(self.values[i])))
            rows.append(
                (
                    name,
                    delay,
                    None if delay is None else delay * self.sample_time_s,
                    float(self.values[i, peak]),
                    float(self.time_s[peak]),
                    float(steps[i, -1]),
                    None if errors is None else float(half_width() * errors[i, -1]),
                )
            )
        told = "delay: first lag that chance does not explain"
        notes = (str(self.feedback) if self.feedback.may_turn_round else told, self.reason)
        return Table(repr(self), columns, tuple(rows), tuple(filter(None, notes)))

    def _computed(self) -> dict[str, object]:
        return {"stderr": self.stderr, "acts_after": self.acts_after}

    def __repr__(self) -> str:
        """Channels, lags and delays on one line."""
        found = ", ".join(f"{name} delay {delay}" for name, delay in self.delays.items())
        return f"ImpulseResponse({self.output!r}, {self.lags.size} lags, {found})"


def named_channels(
    records: Record | Sequence[Record], inputs: Sequence[str] | None, outputs: str | None
) -> tuple[list[Record], tuple[str, ...], str]:
    """Records as a list, with the inputs and the one output that were named or have these roles."""
    listed = list(as_records(records))
    if not listed:
        raise DataError("there is no record", needed="one or more")
    if outputs is None and len(listed[0].outputs) != 1:
        raise OptionError(
            "the output is not said", found=", ".join(listed[0].outputs), needed="output='…'"
        )
    name = listed[0].outputs[0] if outputs is None else outputs
    return listed, tuple(listed[0].inputs if inputs is None else inputs), name


def impulse_response(
    records: Record | Sequence[Record],
    *,
    inputs: Sequence[str] | None = None,
    outputs: str | None = None,
    n_lags: int = 40,
    negative_lags: int = 0,
    kernel: str | None = None,
    offsets: str = "mean",
    loop: Loop | None = None,
) -> ImpulseResponse:
    """Estimate pulse responses from all inputs to one output, with their covariance.

    Least squares on the lagged inputs; what it leaves gives a noise model that whitens everything,
    and least squares again, so that intervals hold for coloured noise.

    Parameters
    ----------
    records : Record or sequence of Record
    inputs : sequence of str, optional
        Default: all inputs.
    outputs : str, optional
        Default: the only output.
    n_lags : int
        Lags from 0 on. Where the last of them are not zero, more are fitted than are returned.
    negative_lags : int
        Lags before 0, which take what feedback brings.
    kernel : {"tc", "dc"}, optional
        Decaying prior for few or poor data; not with negative lags.
    offsets : {"mean", "trim", "none"}
    loop : {"open", "closed"}, optional
        Whether anything moved the inputs after what the outputs did; default: what the records
        know, else a test.

    Raises
    ------
    OptionError
        Lags or kernel outside their range; an output that is not said.
    DataError
        Too few samples, constant or collinear channels.

    Assumes
    -------
    A linear vehicle, in an open loop. Where its response outlasts the longest lags that the
    records allow there are no standard errors, with the reason.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 6.1 and eq. 8.73; Pillonetto et al. (2014),
    Automatica 50.

    Example
    -------
    >>> u = np.random.default_rng(0).standard_normal(800)
    >>> y = filtered([0.0, 0.0, 0.0, 1.0], [1.0, -0.7], u)
    >>> y += 0.1 * np.random.default_rng(1).standard_normal(800)
    >>> record = Record.from_arrays(np.arange(800) / 50, inputs={"u": u}, outputs={"y": y})
    >>> impulse_response(record).delays
    {'u': 3}
    """
    listed, names, name = named_channels(records, inputs, outputs)
    _require(names, n_lags, negative_lags, kernel)
    whole = gather_channels(listed, name, names, offsets)
    whole.require_change()
    data = _shifted(whole, negative_lags)
    n = n_lags + negative_lags
    needed = SAMPLES_PER_COEFFICIENT * n * len(names)
    room = sum(max(0, length - n - WHITENER) for length in data.lengths)
    if room < needed or min(data.lengths) <= n + WHITENER:
        raise DataError(
            "too few samples for the lags",
            found=f"{room} after the first {n + WHITENER} of each record",
            needed=f"at least {needed}",
            action="give longer records or fewer lags",
        )
    fitted, (theta, covariance, rows), ended = _until_ended(data, n, len(names), kernel)
    lags = np.arange(-negative_lags, n_lags)
    parts = [slice(i * fitted, i * fitted + n) for i in range(len(names))]
    values = np.array([theta[part] for part in parts])
    blocks = np.array([covariance[part, part] for part in parts])
    return ImpulseResponse(
        names,
        name,
        lags,
        values,
        blocks if ended else None,
        data.sample_time_s,
        kernel,
        rows,
        whole,
        data.units,
        fitted,
        "" if ended else OUTLASTS.format(fitted),
        loop_told(listed, names, name, loop),
    )


def loop_told(
    records: Sequence[Record], inputs: Sequence[str], output: str, loop: Loop | None
) -> FeedbackTest:
    """Whether a loop was closed, as the test sees it and an autopilot's log knows.

    Parameters
    ----------
    records : sequence of Record
    inputs : sequence of str
    output : str
    loop : {"open", "closed"} or None
    """
    test = feedback_test(records, inputs=inputs, outputs=(output,), loop=loop)
    return unless_logged(test, [each.history for each in records])


def _until_ended(
    data: SampledChannels, n: int, count: int, kernel: str | None
) -> tuple[int, tuple[Array, Array, int], bool]:
    """Lags that were fitted, the estimate, and whether the response ends within them.

    What a response does after the last lag goes into the lags before, as far as inputs are
    coloured; so lags are doubled until the last of them are zero or the records are used up.

    Where fewer lags were found too few, an end is believed once twice as many say the same: what
    seems to have ended may be a tail that the lags before it have taken up.
    """
    first, ended, doubled = _lagged(data, n), 0, False
    before: tuple[Array, Array, int] | None = None
    while True:
        found = _estimate(data, n, kernel, first)
        parts = [slice(i * n, (i + 1) * n) for i in range(count)]
        tails = [(found[0][part], found[1][part, part]) for part in parts]
        # Of so many lags a sum of squares knows its noise too little: tails of a shape are told.
        if ended and all(vanishes(*tail, ended, count, each=False) for tail in tails):
            assert before is not None
            return ended, before, True
        ends = all(vanishes(*tail, n - max(n // LAST, 1), count) for tail in tails)
        if ends and not doubled:
            return n, found, True
        longer, doubled = 2 * n, True
        room = sum(max(0, length - longer - WHITENER) for length in data.lengths)
        short = room < SAMPLES_PER_COEFFICIENT * longer * count
        if short or min(data.lengths) <= longer + WHITENER:
            return n, found, ends
        first = _lagged(data, longer)
        # Inputs may hold fewer frequencies than so many lags need.
        if first.dependent is not None:
            return n, found, ends
        ended, before, n = (n if ends else 0), found, longer


def _lagged(data: SampledChannels, n: int) -> LinearRegression:
    return regress_lags(data.output, data.inputs, data.lengths, n, n - 1, levels=data.levels)


def _require(names: tuple[str, ...], n_lags: int, negative_lags: int, kernel: str | None) -> None:
    if not names:
        raise OptionError("there is no input", needed="one or more")
    if n_lags < 1 or negative_lags < 0:
        raise OptionError(
            "lags are outside their range",
            found=f"n_lags {n_lags}, negative_lags {negative_lags}",
            needed="n_lags from 1, negative_lags from 0",
        )
    if kernel not in (None, *KERNELS):
        raise OptionError("unknown kernel", found=kernel, needed=", ".join(KERNELS))
    if kernel and negative_lags:
        raise OptionError("a decaying prior has no lags before the pulse", needed="kernel=None")


def _shifted(data: SampledChannels, negative: int) -> SampledChannels:
    """Inputs `negative` samples early, so that lag 0 of the regression is lag -negative."""
    if negative == 0:
        return data
    keep = [slice(span.start, span.stop - negative) for span in data.spans]
    late = [slice(span.start + negative, span.stop) for span in data.spans]
    output = np.concatenate([data.output[span] for span in keep])
    inputs = np.concatenate([data.inputs[:, span] for span in late], axis=1)
    lengths = tuple(length - negative for length in data.lengths)
    return replace(data, output=output, inputs=inputs, lengths=lengths)


def _estimate(
    data: SampledChannels, n: int, kernel: str | None, first: LinearRegression
) -> tuple[Array, Array, int]:
    left, start = np.array(data.output), first.shortest
    for i, row in enumerate(data.inputs):
        for span in data.spans:
            left[span] -= filtered(start[i * n : (i + 1) * n], [1.0], row[span])
    inside = np.concatenate([left[span][n - 1 :] for span in data.spans])
    lengths = [length - n + 1 for length in data.lengths]
    noise = regress(
        inside, np.empty((0, inside.size)), lengths, WHITENER, [], [], levels=data.levels
    ).shortest
    whitener = np.concatenate([[1.0], noise])
    signals = np.vstack([data.output, data.inputs])
    for span in data.spans:
        signals[:, span] = filtered(whitener, [1.0], signals[:, span])
    final = regress_lags(
        signals[0], signals[1:], data.lengths, n, n - 1 + WHITENER, levels=data.levels
    )
    if final.dependent is not None:
        raise DataError(
            "the inputs do not determine the response at every lag",
            found=f"{n} lags of {len(data.inputs)} inputs",
            action="use fewer lags or a richer input",
        )
    if kernel is not None:
        smooth = kernel_estimate(final, [n] * len(data.inputs), kernel)
        return smooth.theta, smooth.covariance, final.n_rows
    variance = final.sum_of_squares / (final.n_rows - final.theta.size)
    return final.theta, variance * inverse_square(final.factor), final.n_rows
