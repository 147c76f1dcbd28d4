"""Regressor vectors and targets of records, scaled, for a NARX fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.models.narx.scaling import Scaling
from flightid.models.narx.structure import NarxStructure
from flightid.models.sampled.channels import record_ends, still_words
from flightid.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Regressors:
    """Regressor vectors (n_samples, n_lags) and targets (n_samples,), in deviations.

    `lengths` are the samples of each record.
    """

    vectors: Array
    target: Array
    lengths: tuple[int, ...]


def scaling_of(model: NarxStructure, records: Sequence[Record]) -> Scaling:
    """Means and deviations of the channels over all records; a constant channel is refused."""
    mean, deviation, units = {}, {}, {}
    for name in (model.output, *model.inputs):
        samples = np.concatenate([record[name] for record in records])
        mean[name] = float(np.mean(samples))
        deviation[name] = float(np.std(samples, ddof=1))
        units[name] = records[0].unit(name)
        if deviation[name] <= 1e-14 * abs(mean[name]):
            raise DataError(
                f"channel {name!r} is constant",
                found=" and ".join(
                    still_words(mean[name], record_ends(record)) for record in records
                ),
                needed="a channel that changes",
                action="leave the channel out or choose another record",
            )
    output = np.concatenate([record[model.output] for record in records])
    low, high = (
        float((value - mean[model.output]) / deviation[model.output])
        for value in (output.min(), output.max())
    )
    return Scaling(mean, deviation, units, records[0].sample_time_s, (low, high))


def regressors_of(
    model: NarxStructure, scaling: Scaling, records: Sequence[Record]
) -> tuple[Regressors, Regressors]:
    """Samples to choose terms on, and to estimate their weights on: the same, or each record's end.

    Samples that start the lags are left out.
    """
    start = max(lag.lag for lag in model.lags)
    chosen_on, estimated_on = [], []
    for record in records:
        data = {name: scaling.scaled(record, name) for name in (model.output, *model.inputs)}
        n = record.n_samples
        if n > start:
            rows = np.array(
                [data[lag.channel][start - lag.lag : n - lag.lag] for lag in model.lags]
            )
            target = data[model.output][start:]
            cut = target.size - round(model.held_back * target.size)
            chosen_on.append((rows[:, :cut].T, target[:cut]))
            if model.held_back:
                estimated_on.append((rows[:, cut:].T, target[cut:]))
    first = _joined(chosen_on, model, start)
    return first, _joined(estimated_on, model, start) if model.held_back else first


def _joined(parts: Sequence[tuple[Array, Array]], model: NarxStructure, start: int) -> Regressors:
    n_samples = sum(target.size for _, target in parts)
    least = len(model.lags) + 3
    if n_samples < least:
        part = ", and of the part held back," if model.held_back else ""
        raise DataError(
            "too few samples for the lags",
            found=f"{n_samples} after the first {start} of each record",
            needed=f"at least {least}{part}",
            action="give longer records or fewer lags",
        )
    vectors = np.ascontiguousarray(np.concatenate([rows for rows, _ in parts]))
    lengths = tuple(target.size for _, target in parts)
    return Regressors(vectors, np.concatenate([target for _, target in parts]), lengths)
