"""Which data a fit was made of, and where its records were: offsets and scales."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import asdict

import numpy as np

from flightid.frozen import dataclass
from flightid.record import Record
from flightid.record.digest import TRAINING, digest_of
from flightid.responses import FrequencyResponse


@dataclass(frozen=True)
class TrainingChannel:
    """One channel over all training records.

    Attributes
    ----------
    mean : float
        Over all samples, in `unit`.
    scale : float
        Standard deviation (N - 1) about it, in `unit`.
    trim : float or None
        Declared trim, averaged over all samples; None where a record declares none.
    unit : str

    Example
    -------
    >>> TrainingChannel(1.0, 0.5, None, "V").scale
    0.5
    """

    mean: float
    scale: float
    trim: float | None
    unit: str

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return asdict(self)


def training_channels(records: Sequence[Record]) -> dict[str, TrainingChannel]:
    """Mean, scale and trim of the channels that all records hold.

    Parameters
    ----------
    records : sequence of Record

    Returns
    -------
    dict of str to TrainingChannel

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.1], inputs={"u": [1.0, 3.0]}, units={"u": "V"})
    >>> training_channels([record])["u"].mean
    2.0
    """
    found = {}
    for name in records[0].channels if records else ():
        if not all(name in record for record in records):
            continue
        samples = np.concatenate([record[name] for record in records])
        trims = [record.trim.get(name) for record in records]
        known = [trim for trim in trims if trim is not None]
        weights = [record.n_samples for record in records]
        trim = float(np.average(known, weights=weights)) if len(known) == len(records) else None
        found[name] = TrainingChannel(
            float(np.mean(samples)), float(np.std(samples, ddof=1)), trim, records[0].unit(name)
        )
    return found


def data_provenance(data: Iterable[object], channels: Sequence[str]) -> dict[str, object]:
    """What the provenance of every fit says of its data.

    Parameters
    ----------
    data : iterable of FrequencyResponse or Record
    channels : sequence of str
        Of the model.

    Returns
    -------
    dict of str to object
        ``data_sha256`` of all data together; ``training_records``, the digest of each record that
        was fitted or that a response was estimated from.
    """
    whole, digests = hashlib.sha256(), []
    for item in data:
        if isinstance(item, FrequencyResponse):
            digests += [each.to_dict() for each in item.digests]
            for array in (item.omega_rad_s, item.response, item.coherence, item.random_error):
                whole.update(np.ascontiguousarray(array).tobytes())
        elif isinstance(item, Record):
            made = digest_of(item, channels)
            digests.append(made.to_dict())
            whole.update(made.sha256.encode())
    return {"data_sha256": whole.hexdigest(), TRAINING: digests}
