"""What the worst of many draws promises: distribution-free content by order statistics."""

from __future__ import annotations

import math

import scipy

from flightid.errors import OptionError

CONFIDENCE = 0.95
"""With which a share of plants is told from draws."""
ENOUGH = 0.95
"""Share of the plants that the data allow for which gains must hold."""
MOST = 0.9
"""Share of the plants drawn below which gains by hand are none."""


def content_of_worst(count: int, confidence: float = CONFIDENCE) -> float:
    """Share of all plants that do at least as well as the worst of `count` fresh draws.

    Parameters
    ----------
    count : int
        Number of independent draws that the design has not seen.
    confidence : float
        Confidence of the statement.

    Returns
    -------
    float

    Raises
    ------
    OptionError
        No draws, or a confidence that is no probability.

    Reference
    ---------
    Wilks, *Annals of Mathematical Statistics* 12 (1941), 91–96: (1 − confidence)^(1/count).

    Example
    -------
    >>> round(content_of_worst(59), 3)
    0.95
    """
    _require(count, confidence)
    return float((1.0 - confidence) ** (1.0 / count))


def least_share(good: int, count: int, confidence: float = CONFIDENCE) -> float:
    """Lower confidence bound of the share of plants that meet all requirements.

    Parameters
    ----------
    good : int
        Fresh draws that meet them.
    count : int
        Fresh draws in all.
    confidence : float
        Confidence of the bound.

    Returns
    -------
    float

    Raises
    ------
    OptionError
        Counts that do not fit, or a confidence that is no probability.

    Reference
    ---------
    Clopper & Pearson, *Biometrika* 26 (1934), 404–413; with all good it is `content_of_worst`.

    Example
    -------
    >>> round(least_share(59, 59), 3), round(least_share(92, 93), 3)
    (0.95, 0.95)
    """
    _require(count, confidence)
    if not 0 <= good <= count:
        raise OptionError("counts do not fit", found=f"{good} of {count}", needed="0 to all")
    if good == 0:
        return 0.0
    return float(scipy.special.betaincinv(good, count - good + 1, 1.0 - confidence))


def _require(count: int, confidence: float) -> None:
    if count < 1 or not (0.0 < confidence < 1.0 and math.isfinite(confidence)):
        raise OptionError(
            "no statement about content",
            found=f"{count} draws at confidence {confidence}",
            needed="one draw or more, and a confidence between 0 and 1",
        )
