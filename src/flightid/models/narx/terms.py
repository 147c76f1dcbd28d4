"""The terms of a NARX model as typed objects, and the conventions of a radial width."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from flightid.errors import OptionError

# β = factor · width. MATLAB's radbas is exp(−(0.8326 d / spread)²): one half at d = spread.
WIDTH_FACTORS = {"beta": 1.0, "matlab_spread": 1.0 / 0.8326, "sigma": math.sqrt(2.0)}
KERNELS = ("gaussian", "multiquadric", "inverse_multiquadric", "thin_plate")


def width_to_beta(width: float, convention: str) -> float:
    """β of exp(−d²/β²) from a width in another convention.

    Example
    -------
    >>> round(width_to_beta(1.0, "matlab_spread"), 4), round(width_to_beta(1.0, "sigma"), 4)
    (1.2011, 1.4142)
    """
    if convention not in WIDTH_FACTORS:
        raise OptionError(
            "unknown width convention", found=convention, needed=", ".join(WIDTH_FACTORS)
        )
    if not (math.isfinite(width) and width > 0):
        raise OptionError("a radial width has no meaning", found=width, needed="a positive number")
    return width * WIDTH_FACTORS[convention]


@dataclass(frozen=True, order=True)
class Lag:
    """One regressor: a channel some samples back.

    Example
    -------
    >>> print(Lag("theta", 2))
    theta(t-2)
    """

    channel: str
    lag: int

    def __str__(self) -> str:
        """Channel and lag as in a difference equation."""
        return f"{self.channel}(t-{self.lag})" if self.lag else f"{self.channel}(t)"


@dataclass(frozen=True)
class Term:
    """One term: a product of regressors, or a radial function of all of them.

    Attributes
    ----------
    factors : tuple of (Lag, int)
        Regressors with powers; empty for the constant and for radial functions.
    centre : tuple of float
        Centre of a radial function in deviations about the mean, one entry for each regressor of
        the model; empty for the others.
    name : str
        For people.

    Example
    -------
    >>> term = product_term([Lag("u", 1), Lag("y", 2), Lag("u", 1)])
    >>> term.name, term.kind, term.degree, term.lag
    ('u(t-1)^2 y(t-2)', 'polynomial', 3, 2)
    """

    name: str
    factors: tuple[tuple[Lag, int], ...] = ()
    centre: tuple[float, ...] = ()

    @property
    def degree(self) -> int | None:
        """Total power; None for a radial function."""
        return None if self.centre else sum(power for _, power in self.factors)

    @property
    def lag(self) -> int | None:
        """Longest lag of a product; None for the constant and for radial functions."""
        return max((lag.lag for lag, _ in self.factors), default=None)

    @property
    def kind(self) -> str:
        """``"radial"``, ``"constant"``, ``"linear"`` or ``"polynomial"``."""
        if self.centre:
            return "radial"
        degree = self.degree or 0
        return ("constant", "linear")[degree] if degree < 2 else "polynomial"


def product_term(lags: Iterable[Lag]) -> Term:
    """Term of a product; a lag named twice has power two, no lag is the constant."""
    powers = tuple(Counter(lags).items())
    name = " ".join(f"{lag}^{power}" if power > 1 else str(lag) for lag, power in powers)
    return Term(name or "constant", powers)
