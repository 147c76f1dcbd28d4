"""The verb `feedback_test`: whether a loop was closed around the vehicle of these records."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

from flightid.errors import DataError
from flightid.record import Record
from flightid.record.hold import common_loop
from flightid.record.repeats import found_period
from flightid.record.several import as_records
from flightid.threads import on_one_thread
from flightid.uncertainty.feedback import MAXIMUM_SAMPLES, find_feedback
from flightid.uncertainty.feedback_result import (
    FeedbackTest,
    declared_loop,
    unless_blind,
    unless_spread,
)

KEPT = 4
"""Sets of records whose examination is kept: a scan fits the same ones many times."""


@lru_cache(maxsize=KEPT)
def loop_seen(
    records: tuple[Record, ...], inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> FeedbackTest:
    """`feedback_test` by what records know, made once for all who ask of the same ones."""
    return feedback_test(records, inputs=inputs, outputs=outputs)


@on_one_thread
def feedback_test(
    records: Record | Sequence[Record],
    *,
    inputs: Iterable[str] | None = None,
    outputs: Iterable[str] | None = None,
    loop: str | None = None,
) -> FeedbackTest:
    """Test whether past noise of the outputs moves an input.

    Parameters
    ----------
    records : Record or sequence of Record
        At the sample time of interest: far faster sampling than the loop hides it.
    inputs, outputs : iterable of str, optional
        Channel names; default: those with these roles.
    loop : {"open", "closed"}, optional
        The caller's word; default: what the records know, else the test.

    Raises
    ------
    OptionError
        Another word.
    DataError
        No record, no input or no output.
    UnknownNameError
        A record lacks a channel.

    Assumes
    -------
    Feedback within the same sample cannot be told from direct feedthrough: where input and output
    go together within it, the loop is "unknown".

    Reference
    ---------
    See `flightid.uncertainty.feedback.find_feedback`.

    Example
    -------
    >>> import numpy as np
    >>> u, e = np.random.default_rng(0).standard_normal((2, 1000))
    >>> record = Record.from_arrays(np.arange(1000) / 50, inputs={"u": u}, outputs={"y": e})
    >>> feedback_test(record).loop, str(feedback_test(record, loop="closed"))
    ('open', 'loop closed, as declared')
    """
    listed = list(as_records(records))
    if not listed:
        raise DataError("there is no record", needed="one or more")
    driven = listed[0].inputs if inputs is None else tuple(inputs)
    seen = listed[0].outputs if outputs is None else tuple(outputs)
    if not driven or not seen:
        raise DataError(
            "feedback needs an input and an output", found=", ".join(listed[0].channels)
        )
    known = loop or common_loop([record.input_shape for record in listed])
    if known is not None:
        return declared_loop(known)
    most = MAXIMUM_SAMPLES // len(listed)
    moved = [record.matrix(driven) for record in listed]
    answers = [record.matrix(seen) for record in listed]
    test = find_feedback(
        [(rows - rows.mean(axis=1, keepdims=True))[:, :most] for rows in moved],
        [(rows - rows.mean(axis=1, keepdims=True))[:, :most] for rows in answers],
        driven,
        repeats=all(found_period(rows) is not None for rows in moved),
    )
    return unless_spread(unless_blind(test), [each.history for each in listed], (*driven, *seen))
