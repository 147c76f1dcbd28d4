"""What a disk of gains and phases means on the real axis and on the unit circle."""

from __future__ import annotations

import numpy as np


def gain_limits(alpha: float, skew: float = 0.0) -> tuple[float, float]:
    """Least and greatest real gain in a disk; 0 and infinity where it sets no limit.

    Parameters
    ----------
    alpha : float
    skew : float

    Returns
    -------
    tuple of float

    Reference
    ---------
    Seiler, Packard & Gahinet (2020), equation 9.

    Example
    -------
    >>> [round(each, 12) for each in gain_limits(2.0 / 3.0)]
    [0.5, 2.0]
    """
    low = (2.0 - alpha * (1.0 - skew)) / (2.0 + alpha * (1.0 + skew))
    below = 2.0 - alpha * (1.0 + skew)
    high = (2.0 + alpha * (1.0 - skew)) / below if below > 0.0 else np.inf
    return max(low, 0.0), high


def phase_limit_deg(alpha: float, skew: float = 0.0) -> float:
    """Phase at which a disk's edge crosses the unit circle, degrees; 180 where it does not.

    Parameters
    ----------
    alpha : float
    skew : float

    Returns
    -------
    float

    Reference
    ---------
    Seiler, Packard & Gahinet (2020), equation 10.

    Example
    -------
    >>> round(phase_limit_deg(2.0 / 3.0), 2)
    36.87
    """
    # (1 + γ₁γ₂)/(γ₁ + γ₂) with both ends' common denominator taken out, so that none is infinite.
    a, b = 2.0 - alpha * (1.0 - skew), 2.0 + alpha * (1.0 + skew)
    c, d = 2.0 + alpha * (1.0 - skew), 2.0 - alpha * (1.0 + skew)
    above, below = b * d + a * c, a * d + b * c
    return float(np.degrees(np.arccos(np.clip(above / below, -1.0, 1.0)))) if below > 0.0 else 180.0
