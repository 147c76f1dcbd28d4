"""Where frequency responses pass the unit circle, the negative real axis or a level."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Crossings:
    """Crossings of several responses, each with its row, in no order across rows.

    Attributes
    ----------
    row : ndarray of int, shape (n,)
        Which response.
    omega : ndarray, shape (n,)
        Frequency, rad/s.
    value : ndarray, shape (n,)
        What the crossing is judged by: phase from −180° in rad at the unit circle, natural
        logarithm of the gain at the negative real axis.
    weight : ndarray, shape (n,)
        +1 where the crossing quantity rises, −1 where it falls.
    """

    row: NDArray[np.intp]
    omega: Array
    value: Array
    weight: Array

    def kept(self, which: NDArray[np.bool_]) -> Crossings:
        """Those that are chosen."""
        return Crossings(self.row[which], self.omega[which], self.value[which], self.weight[which])

    def joined(self, other: Crossings) -> Crossings:
        """Both lists."""
        return Crossings(
            np.concatenate([self.row, other.row]),
            np.concatenate([self.omega, other.omega]),
            np.concatenate([self.value, other.value]),
            np.concatenate([self.weight, other.weight]),
        )


def gains_at(values: Complex) -> Array:
    """Natural logarithm of the gain."""
    return np.asarray(np.log(np.abs(values)))


def phases_from_axis(values: Complex) -> Array:
    """Phase from −180°, rad in [−π, π); a point on the real axis belongs to the half above."""
    phase = np.angle(-values)
    return np.asarray(np.where(values.imag >= 0.0, -np.abs(phase), phase))


def gain_crossings(logs: Array, rows: Complex) -> Crossings:
    """Passages through the unit circle with the phase from −180°, rad in (−π, π].

    Parameters
    ----------
    logs : ndarray, shape (n_f,)
        Logarithms of the frequencies.
    rows : ndarray of complex, shape (n, n_f)
    """
    inside = rows.real**2 + rows.imag**2 < 1.0
    row, left = np.nonzero(inside[:, 1:] != inside[:, :-1])
    one, two = rows[row, left], rows[row, left + 1]
    gain = gains_at(one)
    rise = gains_at(two) - gain
    share = -gain / rise
    phase = phases_from_axis(one) + share * np.angle(two / one)
    return Crossings(row, _between(logs, left, share), _wrapped(phase), np.sign(rise))


def phase_crossings(logs: Array, rows: Complex) -> Crossings:
    """Passages through the negative real axis with the logarithm of the gain.

    Parameters
    ----------
    logs : ndarray, shape (n_f,)
        Logarithms of the frequencies.
    rows : ndarray of complex, shape (n, n_f)
    """
    above = rows.imag >= 0.0
    row, left = np.nonzero(above[:, 1:] != above[:, :-1])
    one, two = rows[row, left], rows[row, left + 1]
    before, turn = phases_from_axis(one), np.angle(two / one)
    # A turn that does not lead through zero passes the positive axis instead.
    passes = np.where(above[row, left], before + turn > 0.0, before + turn <= 0.0)
    row, left, one, two = row[passes], left[passes], one[passes], two[passes]
    before, turn = before[passes], turn[passes]
    share = -before / turn
    gain = gains_at(one)
    value = gain + share * (gains_at(two) - gain)
    return Crossings(row, _between(logs, left, share), value, np.sign(turn))


def level_crossings(logs: Array, height: Array) -> Crossings:
    """Passages of real curves through zero; their value is zero.

    Parameters
    ----------
    logs : ndarray, shape (n_f,)
        Logarithms of the frequencies.
    height : ndarray, shape (n, n_f)
    """
    above = height > 0.0
    row, left = np.nonzero(above[:, 1:] != above[:, :-1])
    one, two = height[row, left], height[row, left + 1]
    share = one / (one - two)
    return Crossings(row, _between(logs, left, share), np.zeros(len(row)), np.sign(two - one))


def _between(logs: Array, left: NDArray[np.intp], share: Array) -> Array:
    return np.asarray(np.exp(logs[left] + share * (logs[left + 1] - logs[left])))


def _wrapped(phase: Array) -> Array:
    """Into (−π, π]."""
    return np.asarray(np.pi - np.mod(np.pi - phase, 2.0 * np.pi))
