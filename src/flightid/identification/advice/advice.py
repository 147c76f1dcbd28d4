"""Advice before a fit: what the records can support, and what to do about what they cannot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import DataError, FitError, SingularError
from flightid.evidence import FeedbackTest
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.advice.delays import InputDelay, find_delays
from flightid.identification.advice.impulse_response import (
    ImpulseResponse,
    impulse_response,
    loop_told,
    named_channels,
)
from flightid.identification.prediction_error.sampling_rate import SAMPLING
from flightid.identification.subspace.fit import fit_subspace
from flightid.models import InnovationsModel
from flightid.models.sampled.channels import SampledChannels, gather_channels
from flightid.record import Record
from flightid.record.hold import Loop
from flightid.result import Result
from flightid.table import Column, Table
from flightid.threads import on_one_thread

Array = NDArray[np.float64]
LARGEST_ORDER = 50
SMALLEST_SHARE = 1e-6
POOR_ORDER = 10
ALIKE, RELATED = 0.95, 0.5
SLOW = 0.999
LAGS_BEFORE = 10
"""Lags before the pulse take what feedback brings, so that delays are not read from it."""


@dataclass(frozen=True, eq=False, repr=False)
class Advice(Result, schema="flightid.advice/1"):
    """Result of `flightid.advise`.

    Attributes
    ----------
    inputs : tuple of str
    output : str
    n_samples, n_records : int
    excitation_orders : mapping of str to int
        Order of persistent excitation of each input, at most 50: how many coefficients of B and A
        together it can tell apart.
    response : ImpulseResponse or None
        None where the records are too short for it.
    feedback : FeedbackTest
        Whether a loop was closed, tested or declared.
    acts_after : mapping of str to InputDelay
        Samples until each input acts.
    findings : tuple of Finding

    Example
    -------
    >>> Advice(("u",), "y", 500, 1, {"u": 2}, None, FeedbackTest("open", "declared"))
    Advice('y' from u, 500 samples in 1 record, excitation order 2)
    """

    inputs: tuple[str, ...]
    output: str
    n_samples: int
    n_records: int
    excitation_orders: Mapping[str, int]
    response: ImpulseResponse | None
    feedback: FeedbackTest
    acts_after: Mapping[str, InputDelay] = field(default_factory=dict)
    findings: tuple[Finding, ...] = field(default=())

    @property
    def delays(self) -> dict[str, int | None]:
        """Samples until each input acts; None where no effect stands out, or it is too unsure."""
        return {name: each.samples for name, each in self.acts_after.items()}

    def summary(self) -> Table:
        """Table by input, with the findings below."""
        columns = (
            Column("input"),
            Column("excitation order"),
            Column("delay", "samples"),
        )
        rows = tuple(
            (name, self.excitation_orders[name], self.delays.get(name)) for name in self.inputs
        )
        loop = str(self.feedback)
        notes = (f"{loop[0].upper()}{loop[1:]}.", *map(str, self.findings))
        return Table(repr(self), columns, rows, notes)

    def __repr__(self) -> str:
        """Channels, size and the poorest excitation on one line."""
        records = f"{self.n_records} record{'' if self.n_records == 1 else 's'}"
        least = min(self.excitation_orders.values(), default=0)
        return (
            f"Advice({self.output!r} from {', '.join(self.inputs)}, {self.n_samples} samples in "
            f"{records}, excitation order {least})"
        )


@on_one_thread
def advise(
    records: Record | Sequence[Record],
    *,
    inputs: Sequence[str] | None = None,
    outputs: str | None = None,
    n_lags: int = 40,
    loop: Loop | None = None,
) -> Advice:
    """Judge records before a black-box fit: excitation, delay, feedback, sampling, offsets.

    Parameters
    ----------
    records : Record or sequence of Record
    inputs : sequence of str, optional
        Default: all inputs.
    outputs : str, optional
        Default: the only output.
    n_lags : int
        Lags of the pulse response behind the delay.
    loop : {"open", "closed"}, optional
        Whether anything moved the inputs after what the outputs did; default: what the records
        know (an autopilot's log flies closed), else a test.

    Raises
    ------
    OptionError
        An output that is not said.
    DataError
        No record, constant channels, or sample times that differ.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., definition 13.2 (persistence of excitation), section
    14.4 (feedback), section 13.7 (sampling interval).

    Example
    -------
    >>> u = np.sin(0.3 * np.arange(600))
    >>> y = np.convolve(u, [0.0, 0.5, 0.3])[:600]
    >>> record = Record.from_arrays(np.arange(600) / 20, inputs={"u": u}, outputs={"y": y})
    >>> advise(record).findings[0].code
    'poor-excitation'
    """
    listed, names, name = named_channels(records, inputs, outputs)
    data = gather_channels(listed, name, names, "mean")
    data.require_change()
    orders = {
        each: excitation_order(row, data) for each, row in zip(names, data.inputs, strict=True)
    }
    response = None
    reason = ""
    try:
        response = impulse_response(
            listed, outputs=name, inputs=names, n_lags=n_lags, negative_lags=LAGS_BEFORE, loop=loop
        )
    except DataError as error:
        reason = str(error)
    if response is None:
        feedback = loop_told(listed, names, name, loop)
        acts = dict.fromkeys(names, InputDelay())
        if not feedback.may_turn_round:
            acts = dict(zip(names, find_delays(data, n_lags - 1), strict=True))
    else:
        feedback, acts = response.feedback, dict(response.acts_after)
    answers = any(each.interval is not None for each in acts.values())
    findings = (
        *_excitation(orders, feedback),
        *_related(names, data),
        *_pulse(reason),
        *_delays(name, acts, data.sample_time_s, feedback, listed[0].excitations),
        *_feedback(feedback),
        # Without an answer, or along a loop, poles are those of noise, or of the controller.
        *(
            _sampling(name, data)
            or (_poles(name, names, listed) if answers and feedback.loop == "open" else ())
        ),
        *_levels(names, data),
    )
    return Advice(
        names, name, data.output.size, len(listed), orders, response, feedback, acts, findings
    )


def excitation_order(row: Array, data: SampledChannels) -> int:
    """Order of persistent excitation: rank of the covariance of as many successive samples."""
    size = min(LARGEST_ORDER, min(data.lengths) // 4)
    sums = np.zeros(size)
    for span in data.spans:
        part = row[span] - row[span].mean()
        for lag in range(size):
            sums[lag] += part[lag:] @ part[: part.size - lag]
    values = np.linalg.eigvalsh(scipy.linalg.toeplitz(sums / row.size))
    # A record's end leaks a share of 1/N into directions that the input itself does not excite.
    floor = max(SMALLEST_SHARE, 4.0 / row.size)
    return int(np.sum(values > floor * values[-1]))


def _excitation(orders: Mapping[str, int], test: FeedbackTest) -> list[Finding]:
    found = []
    # What a loop feeds back counts to the order, and excites nothing.
    fit = "" if test.may_turn_round else "fit at most {} coefficients, or "
    for name, order in orders.items():
        if order < POOR_ORDER:
            light = Light.RED if order < 4 else Light.AMBER
            found.append(
                Finding(
                    "poor-excitation",
                    light,
                    f"input {name!r} is persistently exciting of order {order} only",
                    f"{fit.format(order)}fly a sweep, multisine or PRBS",
                )
            )
    return found


def _related(names: Sequence[str], data: SampledChannels) -> list[Finding]:
    found = []
    matrix = np.atleast_2d(np.corrcoef(data.inputs))
    for i in range(len(names)):
        for j in range(i):
            size = abs(float(matrix[i, j]))
            if size > RELATED:
                light = Light.RED if size > ALIKE else Light.AMBER
                found.append(
                    Finding(
                        "related-inputs",
                        light,
                        f"inputs {names[j]!r} and {names[i]!r} are correlated, {size:.2f}",
                        "excite one at a time, or with different sequences",
                    )
                )
    return found


def _pulse(reason: str) -> list[Finding]:
    if not reason:
        return []
    action = "use a richer input or longer records, or give fewer lags"
    return [Finding("no-pulse-response", Light.AMBER, f"no pulse response: {reason}", action)]


def _delays(
    output: str,
    acts: Mapping[str, InputDelay],
    sample_time_s: float,
    test: FeedbackTest,
    injected: Sequence[str],
) -> list[Finding]:
    if test.may_turn_round:
        message = (
            f"how late {output!r} answers {', '.join(map(repr, acts))}, and by which poles, cannot "
            "be told: in a loop what is seen may be the controller turned round"
        )
        way = "name what was injected where the file holds it (excitations), else log it; fit by it"
        if injected:
            way = f"fit by way of {', '.join(injected)} (excitations)"
        action = f"{way}, comparing nk from 1 on; or record with the loop open"
        return [Finding("answer-untold", Light.AMBER, message, action)]
    found = []
    if_open = "" if test.is_known else "if the loop was open: "
    for name, each in acts.items():
        if each.interval is None:
            message = f"no response of {output!r} to {name!r} stands out of the noise"
            action = "excite this input more, or leave it out"
            found.append(Finding("no-response", Light.RED, message, action))
        elif each.samples is None:
            low, high = each.interval
            message = (
                f"{if_open}{output!r} answers {name!r} after {low} to {high} samples: nk is unsure"
            )
            action = "fit each of them and compare (scan_orders), or excite higher frequencies"
            found.append(Finding("delay-unsure", Light.AMBER, message, action))
        else:
            message = (
                f"{if_open}{output!r} answers {name!r} after {each.samples} samples "
                f"({each.samples * sample_time_s:.4g} s): nk = {each.samples}"
            )
            light, action = Light.GREEN, ""
            if not test.is_known:
                light, action = Light.AMBER, "declare the loop before this delay is used"
            found.append(Finding("delay", light, message, action))
    return found


def _feedback(test: FeedbackTest) -> list[Finding]:
    if test.source in ("same sample", "noisy input", "blind"):
        action = "declare loop='open' where no controller moved the input; else fit a noise model"
        return [Finding("feedback-unknown", Light.UNKNOWN, str(test), action)]
    if not test.is_closed:
        return []
    return [
        Finding(
            "feedback",
            Light.AMBER,
            str(test),
            "fit a noise model (ARMAX, BJ); do not use OE, IV4 or the pulse response",
        )
    ]


def _sampling(name: str, data: SampledChannels) -> list[Finding]:
    pairs = [(data.output[s][1:], data.output[s][:-1]) for s in data.spans]
    size = sum(float(a @ a + b @ b) / 2 for a, b in pairs)
    share = sum(float(a @ b) for a, b in pairs) / size
    if share <= SLOW:
        return []
    return [
        Finding(
            "sampled-fast",
            Light.AMBER,
            f"successive samples of {name!r} differ little (correlation {share:.5f}): discrete "
            "poles crowd at one",
            "resample to about ten times the bandwidth (conditioning.resample)",
        )
    ]


def _poles(name: str, names: Sequence[str], records: Sequence[Record]) -> list[Finding]:
    """What the poles of a state-space model of the usual order say of the sampling rate."""
    structure = InnovationsModel.subspace(names, (name,))
    try:
        fit = fit_subspace(structure, records)
    except (DataError, FitError, SingularError):
        return []
    return [each for each in fit.findings if each.code in SAMPLING]


def _levels(names: Sequence[str], data: SampledChannels) -> list[Finding]:
    found = []
    for name, row in zip(names, data.inputs, strict=True):
        if all(np.unique(np.round(row[s], 12)).size == 2 for s in data.spans):
            found.append(
                Finding(
                    "two-levels",
                    Light.GREEN,
                    f"input {name!r} has two levels: residual tests cannot see even nonlinearity",
                    "add a record with more levels to see it",
                )
            )
    return found
