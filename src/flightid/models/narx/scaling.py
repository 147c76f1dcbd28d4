"""Means and deviations of the records that a NARX model was trained on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.record import Record
from flightid.units import clash, match


@dataclass(frozen=True)
class Scaling:
    """Means and deviations (N - 1) of the training records by channel, and their units.

    `output_range` holds the smallest and largest training output, in deviations.
    """

    mean: dict[str, float]
    deviation: dict[str, float]
    units: dict[str, str]
    sample_time_s: float
    output_range: tuple[float, float]

    def scaled(self, record: Record, name: str) -> NDArray[np.float64]:
        """Samples of a channel in deviations about the training mean, after checks."""
        if not match(record.unit(name), self.units[name]):
            raise clash(name, record.unit(name), self.units[name], where="than in training")
        self.require_sample_time(record.sample_time_s)
        return np.ascontiguousarray((record[name] - self.mean[name]) / self.deviation[name])

    def require_sample_time(self, sample_time_s: float) -> None:
        """Refuse another sample time than that of the training records.

        Raises
        ------
        DataError
            It differs.
        """
        if abs(sample_time_s / self.sample_time_s - 1.0) > 1e-6:
            raise DataError(
                "the record has another sample time than the model's training records",
                found=f"{sample_time_s:.6g} s",
                needed=f"{self.sample_time_s:.6g} s",
                action="resample it with conditioning.resample",
            )

    def to_dict(self) -> dict[str, object]:
        """Plain values without the units."""
        return {
            "mean": {name: float(value) for name, value in self.mean.items()},
            "deviation": {name: float(value) for name, value in self.deviation.items()},
            "sample_time_s": float(self.sample_time_s),
            "output_range": [float(value) for value in self.output_range],
        }
