"""What works on the samples of a record refuses: numbers of which no powers are numbers."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.record.samples import LabelledSamples
from flightid.record.validation import LARGEST, SMALLEST


def require_workable(record: LabelledSamples, channels: Iterable[str]) -> None:
    """Refuse channels of which no powers are numbers.

    A record keeps them, for it is written and read to the last bit; what works on them asks here.

    Raises
    ------
    DataError
        A channel's largest sample is above 1e75, or below 1e-75 and not zero.

    Example
    -------
    >>> from flightid.record import Record
    >>> record = Record.from_arrays([0.0, 0.1], outputs={"p": [1.0, 2.0]})
    >>> require_workable(record, ["p"])
    """
    for name in channels:
        record.once(("workable", name), partial(_require_size, name, record[name]))


def _require_size(name: str, samples: NDArray[np.float64]) -> None:
    peak = float(np.max(np.abs(samples)))
    if peak == 0.0 or SMALLEST <= peak <= LARGEST:
        return
    raise DataError(
        f"channel {name!r} is too {'large' if peak > LARGEST else 'small'} to be worked with",
        found=f"samples up to {peak:.3g}, at index {int(np.argmax(np.abs(samples)))}",
        needed=f"a largest sample from {SMALLEST:g} to {LARGEST:g}, or zeros alone",
        action="cut the segment before the fault, or scale the channel to another unit",
    )
