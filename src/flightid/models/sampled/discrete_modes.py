"""Roots of a discrete-time model as natural frequencies and dampings, s = ln z / T."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.table import Cell, Column, Table

NO_COUNTERPART = "a negative real pole has no real continuous counterpart"
AT_ORIGIN = "a pole at the origin is a delay"


@dataclass(frozen=True)
class DiscreteMode:
    """One real pole, or the upper one of a conjugate pair.

    Attributes
    ----------
    z : complex
        Pole in the z plane.
    s : complex or None
        ln z / T, rad/s; None where `reason` says why there is none.
    natural_frequency_rad_s : float or None
        |s|; for a real pole its corner frequency.
    damping : float or None
        -Re s / |s|.
    reason : str
        Why a value is missing.

    Example
    -------
    >>> mode = discrete_modes([0.9 + 0.2j, 0.9 - 0.2j, -0.4], 0.1)
    >>> [round(item.z.real, 1) for item in mode], mode[1].reason
    ([0.9, -0.4], 'a negative real pole has no real continuous counterpart')
    """

    z: complex
    s: complex | None
    natural_frequency_rad_s: float | None
    damping: float | None
    reason: str = ""

    @property
    def is_pair(self) -> bool:
        """Whether the conjugate pole belongs to the mode."""
        return self.z.imag != 0.0

    @property
    def time_constant_s(self) -> float | None:
        """-1/Re s, s: decay time; negative for growth; None without one."""
        if self.s is None or self.s.real == 0.0:
            return None
        return -1.0 / self.s.real

    def to_dict(self) -> dict[str, object]:
        """Plain values; complex numbers as [real, imaginary]."""
        return {
            "z": [self.z.real, self.z.imag],
            "s": None if self.s is None else [self.s.real, self.s.imag],
            "natural_frequency_rad_s": self.natural_frequency_rad_s,
            "damping": self.damping,
            "time_constant_s": self.time_constant_s,
            "reason": self.reason,
        }


def discrete_modes(
    poles: Iterable[complex] | NDArray[np.complex128], sample_time_s: float
) -> tuple[DiscreteMode, ...]:
    """Modes of discrete poles, the slowest first; one for each conjugate pair.

    Parameters
    ----------
    poles : iterable of complex
    sample_time_s : float
        Sample time T, s.

    Returns
    -------
    tuple of DiscreteMode

    Reference
    ---------
    Åström & Wittenmark, *Computer-Controlled Systems*, 3rd ed., section 2.5.

    Example
    -------
    >>> discrete_modes([math.exp(-0.5)], 0.1)[0].time_constant_s
    0.2
    """
    modes = [_mode(complex(z), sample_time_s) for z in poles if complex(z).imag >= 0.0]
    return tuple(
        sorted(
            modes,
            key=lambda mode: (
                math.inf if mode.natural_frequency_rad_s is None else mode.natural_frequency_rad_s,
                -abs(mode.z),
            ),
        )
    )


def _mode(z: complex, sample_time_s: float) -> DiscreteMode:
    if z == 0.0:
        return DiscreteMode(z, None, None, None, AT_ORIGIN)
    if z.imag == 0.0 and z.real < 0.0:
        return DiscreteMode(z, None, None, None, NO_COUNTERPART)
    s = cmath.log(z) / sample_time_s
    if s == 0.0:
        return DiscreteMode(z, s, 0.0, None, "an integrator has no damping")
    return DiscreteMode(z, s, abs(s), -s.real / abs(s))


def polynomial_roots(polynomial: Sequence[float] | NDArray[np.float64]) -> NDArray[np.complex128]:
    """Roots z of a polynomial in z⁻¹ without those at the origin that its end brings.

    Example
    -------
    >>> polynomial_roots([1.0, -0.5]).real
    array([0.5])
    """
    return np.asarray(np.roots(np.trim_zeros(np.asarray(polynomial), "fb")), dtype=np.complex128)


def roots_table(
    title: str,
    roots: Iterable[tuple[str, Iterable[DiscreteMode], NDArray[np.complex128] | None]],
    notes: tuple[str, ...] = (),
) -> Table:
    """Poles and zeros by response, with natural frequency, damping and what to know of them."""
    columns = (
        Column("response"),
        Column("root"),
        Column("z real", digits=5),
        Column("z imaginary", digits=5),
        Column("|z|", digits=5),
        Column("natural frequency", "rad/s"),
        Column("damping"),
        Column("note"),
    )
    rows: list[tuple[Cell, ...]] = []
    for response, poles, zeros in roots:
        for mode in poles:
            note = "; ".join(filter(None, (mode.reason, "unstable" if abs(mode.z) > 1.0 else "")))
            shown = (mode.natural_frequency_rad_s, mode.damping, note)
            rows.append((response, "pole", mode.z.real, mode.z.imag, abs(mode.z), *shown))
        rows.extend(
            (response, "zero", z.real, z.imag, abs(z), None, None, zero_note(z))
            for z in map(complex, () if zeros is None else zeros[zeros.imag >= 0])
        )
    return Table(title, columns, tuple(rows), (*notes, "one line for each conjugate pair"))


def zero_note(zero: complex | np.complex128) -> str:
    """What a zero outside the unit circle means; a negative real one comes from sampling.

    Example
    -------
    >>> zero_note(1.2)
    'non-minimum phase'
    """
    if abs(zero) <= 1.0:
        return ""
    if zero.imag == 0.0 and zero.real < 0.0:
        return "outside the circle on the negative axis: sampling makes such zeros"
    return "non-minimum phase"
