"""Where a search for gains ended, or what gains by hand are."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass

Array = NDArray[np.float64]
NO_GAINS = "no-gains"
"""Code of the finding that there are none."""


@dataclass(frozen=True, eq=False)
class GainSearchResult:
    """Where a search ended.

    Attributes
    ----------
    gains : ndarray, shape (n_gains,)
        The best, or those that come nearest to the requirements.
    exists : bool
        Whether they meet every requirement for every plant.
    binding : tuple of str
        Requirements without slack there: what keeps the gains from going further, or what cannot
        be met.
    slack : dict of str to float
        Least slack of each requirement over the plants.
    by_hand : bool
        Whether the gains were given and nothing was searched.
    missed : tuple of str
        Of gains by hand: each requirement that a plant misses, and by how much; see `shortfalls`.
    """

    gains: Array
    exists: bool
    binding: tuple[str, ...]
    slack: dict[str, float]
    by_hand: bool = False
    missed: tuple[str, ...] = ()


def without_gains(findings: Iterable[Finding], binding: Iterable[str]) -> Finding:
    """Why a design has no gains: of its search, or what gains by hand miss and by how much."""
    action = "relax a requirement that cannot be met, or identify better"
    told = Finding(NO_GAINS, Light.RED, ", ".join(binding), action)
    return next((each for each in findings if each.code == NO_GAINS), told)
