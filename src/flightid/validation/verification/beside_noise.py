"""What a prediction's error is beside the white noise of the measurement, which none explains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.identification.prediction.result import Prediction
from flightid.identification.records.white_noise import white_levels
from flightid.simulation import metrics

Array = NDArray[np.float64]
LEVEL_SCATTER = 3.3
"""Over the root of the samples: relative standard error of a white variance that is read as the
median of the squared coefficients in the upper half of the band (1 / (2 f) of chi-square, f its
density at the median .455)."""
TOLD = 2.0
"""Standard errors of the noise that count as what the model may have missed besides."""
SOME = 0.1
"""Share of an error's power from which white noise is worth a word."""


@dataclass(frozen=True)
class BesideNoise:
    """Theil coefficient of the motion and the error without white noise.

    Attributes
    ----------
    noise_percent : float
        Of the error's power that white noise of the measurement makes.
    most : float
        Largest coefficient that the noise level's own error allows; infinite where no motion stands
        above the noise.
    least : float
        The coefficient where the noise is as large as it may be.
    """

    noise_percent: float
    most: float
    least: float


def beside_noise(predictions: Sequence[Prediction], name: str) -> BesideNoise | None:
    """An output's error beside the white noise of its measurement, over all records together.

    Parameters
    ----------
    predictions : sequence of Prediction
    name : str
        Of the output.

    Returns
    -------
    BesideNoise or None
        None of records too short to tell, and where noise is less than `SOME` of the error.

    Reference
    ---------
    Theil, *Economic Forecasts and Policy*, 1961, section 2.5; Morelli, *J. Aircraft* 32 (1995), 1,
    of the noise's level in the upper half of the band.
    """
    pairs = [each.scored(name) for each in predictions]
    try:
        levels = [white_levels(y[None, :])[0] ** 2 for y, _ in pairs]
    except DataError:
        return None
    y, y_hat = (np.concatenate([pair[side] for pair in pairs]) for side in (0, 1))
    noise = float(np.average(levels, weights=[len(pair[0]) for pair in pairs]))
    error = float(metrics.mse(y, y_hat))
    if error <= 0.0 or noise < SOME * error:
        return None
    wide = min(TOLD * LEVEL_SCATTER / np.sqrt(y.size), 1.0)
    motion, said = float(np.mean(y**2)), float(np.sqrt(np.mean(y_hat**2)))
    most, least = (
        _theil(error - level, motion - level, said)
        for level in (noise * (1.0 - wide), noise * (1.0 + wide))
    )
    return BesideNoise(100.0 * min(noise / error, 1.0), most, least)


def _theil(error: float, motion: float, said: float) -> float:
    """Of powers without noise and the root mean square of the prediction."""
    if motion <= 0.0:
        return 0.0 if error <= 0.0 else float("inf")
    return float(np.sqrt(max(error, 0.0)) / (np.sqrt(motion) + said))
