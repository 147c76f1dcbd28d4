"""The least step that a history would have shown: what "no change" was able to see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtr, owens_t

from flightid.fleet.statistics.largest_step import StepScan
from flightid.uncertainty.quantiles import normal_quantiles, student_quantiles

Array = NDArray[np.float64]
POWER = 0.8
"""Share of such steps that would be found."""
LOST = 1.08
"""By which a step is larger for what it does itself: its flights scatter, and may look odd. Without
it 72 % of 291 were found, in fleets of 6 and 10 of 8 to 24 flights, one, two and four a day."""
FURTHEST = 38.0
"""Standard errors beyond which chances are below what numbers hold."""


def least_step(scan: StepScan, chance: float) -> float:
    """Size of the step of which `POWER` are found, its place any of the scan's.

        mean over places of P(|z| > c),  z ~ N(δ / s, 1):  0.8 at this δ, then times `LOST`

    Parameters
    ----------
    scan : StepScan
        Of the history; its standard errors s and places alone count.
    chance : float
        Of a largest step, below which one is called a change.

    Returns
    -------
    float
        In the unit of the history. Cautious: a step is looked for at its own place alone, and by
        the largest step alone.

    Example
    -------
    >>> from flightid.fleet.statistics.largest_step import scan_steps
    >>> round(least_step(scan_steps(np.zeros(12), np.eye(12)), 0.05), 2)
    2.26
    """
    limit = largest_step_bound(scan.correlations, chance)
    spread = 1.0
    if np.isfinite(scan.freedom):
        # Student's t about δ / s as a normal number (Johnson & Welch 1940).
        limit = float(-student_quantiles(ndtr(-limit), scan.freedom))
        spread = float(np.sqrt(1.0 + 0.5 * limit**2 / scan.freedom))
    stderr = np.sqrt(scan.variances)

    def missing(size: float) -> float:
        off = size / stderr
        return float(np.mean(ndtr((off - limit) / spread) + ndtr((-off - limit) / spread))) - POWER

    most = float(stderr.max()) * (limit + 2.0 * spread)
    return LOST * float(brentq(missing, 0.0, most, rtol=1e-6))


def largest_step_bound(correlations: Array, chance: float) -> float:
    """Standard errors that the largest step of none exceeds with a chance, or less often.

    Parameters
    ----------
    correlations : ndarray, shape (m − 1,)
        Between neighbours of the m standardised steps.
    chance : float

    Returns
    -------
    float
        Above the exact limit (`largest_step_chance`) by up to 1 % at 24 places, 2 % at 100, at
        chances of 0.002: neighbours two apart count as if the one between did not.

    Reference
    ---------
    Worsley, *Biometrika* 69 (1982), 297–302 (the bound); Owen, *Ann. Math. Stat.* 27 (1956).
    """
    apart = np.sqrt((1.0 - correlations) / (1.0 + correlations))

    def beyond(limit: float) -> float:
        found = 2.0 * float(ndtr(-limit)) + 4.0 * float(np.sum(owens_t(limit, apart)))
        return float(np.log(found)) - float(np.log(chance))

    least = float(-normal_quantiles(0.5 * chance))
    return least if beyond(least) <= 0.0 else float(brentq(beyond, least, FURTHEST, rtol=1e-6))
