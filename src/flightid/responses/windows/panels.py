"""Slow sinusoids on panels of samples: a space of few dimensions, the exact way to decimate.

On a panel all sinusoids up to a frequency, tapered or not, lie in a space of few dimensions, to
twelve digits. Rows are projected on it, panel by panel, before they meet slow sinusoids; four
panels are one panel of the next level, for sinusoids that are four times as slow. Nothing is
filtered or folded over, ends of windows included, as in a decimated record.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

PANEL = 128
"""Samples in a panel of the first level."""
SLOW = 0.3
"""Highest frequency of its space, rad per sample."""
JOINED = 4
"""Panels that are one panel of the next level."""
RANK = 32
"""Dimensions of the space: they miss less than 1e-12 of any of its sinusoids."""
FEWEST_SLOW = 50
"""Slow frequencies from which on a projection pays."""
PADDED = 1.25
"""Zeros, as a share of a row, up to which joined panels pay."""
Real = NDArray[np.float64]


@dataclass(frozen=True)
class PanelSpace:
    """Orthonormal basis of all sinusoids up to `highest` on one panel.

    Attributes
    ----------
    highest : float
        rad per sample.
    functions : ndarray, shape (size, RANK)
    turn : ndarray, shape (n, rank)
        From what is known of a panel to its coordinates: `functions` from samples, or from the
        coordinates of joined panels.
    """

    highest: float
    functions: Real
    turn: Real

    @property
    def size(self) -> int:
        """Samples in a panel."""
        return len(self.functions)

    def project(self, rows: Real) -> Real:
        """Coordinates on the panels of each row, shape (n_rows, n_panels · rank).

        Parameters
        ----------
        rows : ndarray, shape (n_rows, n)
            Samples of whole panels, or coordinates on those that are joined.
        """
        known = len(self.turn)
        return np.asarray((rows.reshape(-1, known) @ self.turn).reshape(len(rows), -1))

    def sinusoids(self, omega: Real, count: int) -> NDArray[np.complex128]:
        """Coordinates of ``exp(jωd)`` for d from 0 on, shape (n_omega, count · rank).

        Parameters
        ----------
        omega : ndarray
            rad per sample, up to `highest`.
        count : int
            Panels.
        """
        local = exponentials(omega, self.size) @ self.functions
        place = np.exp(1j * np.multiply.outer(omega, self.size * np.arange(count)))
        # No frequency may fall to a level: its size does not follow from the others'.
        whole = count * local.shape[1]
        return np.asarray((place[:, :, None] * local[:, None, :]).reshape(len(omega), whole))


@dataclass(frozen=True)
class PanelBasis:
    """Tapered cosines and sines of some frequencies on the panels of a folded frame.

    Attributes
    ----------
    space : PanelSpace
    cosine, sine : ndarray, shape (n_f, n_panels · rank)
    """

    space: PanelSpace
    cosine: Real
    sine: Real

    @property
    def width(self) -> int:
        """Samples of a row."""
        panels: int = self.cosine.shape[1] // self.space.functions.shape[1]
        return panels * self.space.size


def panel_levels(highest: Real, size: int) -> list[tuple[PanelSpace, int]]:
    """Spaces that pay for rows of so many samples, slowest first, and where each one's part ends.

    Parameters
    ----------
    highest : ndarray, increasing
        Highest frequency in each tapered sinusoid, rad per sample.
    size : int
    """
    first, second = _spaces()
    stops = [int(np.searchsorted(highest, each.highest, "right")) for each in (second, first)]
    if stops[1] < FEWEST_SLOW or size < 2 * PANEL:
        return []
    panels = -(-size // PANEL)
    joined = -(-panels // JOINED) * JOINED
    if stops[0] < FEWEST_SLOW or joined > PADDED * panels:
        return [(first, stops[1])]
    return [(second, stops[0]), (first, stops[1])]


def exponentials(omega: Real, count: int) -> NDArray[np.complex128]:
    """``exp(jωd)`` for d below `count`, from two short tables: coarse steps and fine ones."""
    fine = int(np.ceil(np.sqrt(count)))
    coarse = -(-count // fine)
    small = np.exp(1j * np.multiply.outer(omega, np.arange(fine)))
    large = np.exp(1j * np.multiply.outer(omega, fine * np.arange(coarse)))
    whole = (large[:, :, None] * small[:, None, :]).reshape(len(omega), coarse * fine)
    return np.asarray(whole[:, :count])


@cache
def _spaces() -> tuple[PanelSpace, PanelSpace]:
    """The two levels."""
    functions = _directions(_samples(PANEL, SLOW))
    first = PanelSpace(SLOW, functions, functions)
    highest = SLOW / JOINED
    sinusoids = _samples(JOINED * PANEL, highest).reshape(JOINED, PANEL, -1)
    turn = _directions((functions.T @ sinusoids).reshape(-1, sinusoids.shape[2]))
    joined = functions @ turn.reshape(JOINED, functions.shape[1], -1)
    return first, PanelSpace(highest, joined.reshape(JOINED * PANEL, -1), turn)


def _samples(size: int, highest: float) -> Real:
    """Cosines and sines up to a frequency about the middle of a panel, (size, many)."""
    place = np.arange(size) - (size - 1) / 2.0
    angle = np.multiply.outer(place, highest * np.linspace(0.0, 1.0, PANEL))
    return np.concatenate([np.cos(angle), np.sin(angle)], axis=1)


def _directions(columns: Real) -> Real:
    """Orthonormal directions, those that columns need most."""
    u, _, _ = np.linalg.svd(columns, full_matrices=False)
    return np.ascontiguousarray(u[:, :RANK])
