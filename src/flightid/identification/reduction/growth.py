"""Whether a smaller structure keeps what grows, and the modes that are no integrators."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.models.model import linear_system
from flightid.uncertainty.quantiles import half_width

STILL = 1e-4
"""Share of the largest pole below which one is at rest: rounding leaves as much of four alike."""
FAINT = 0.02
"""Damping up to which a motion of unknown error neither grows nor decays for certain."""
AMONG_THREE_HUNDRED = 0.997
"""Level of an interval beyond which a mode has moved: a path moves several, step by step."""


@dataclass(frozen=True)
class FittedPole:
    """One pole of a fit, of a pair the upper, with its error.

    Attributes
    ----------
    pole : complex
        rad/s.
    deviation : float or None
        Standard error along the largest move, rad/s; None where no error is known.
    real_deviation : float or None
        Of the real part, rad/s.

    Example
    -------
    >>> print(FittedPole(0.0845 + 0.4j, 0.01, 0.01))
    an oscillation of 0.409 rad/s that doubles in 8.2 s
    """

    pole: complex
    deviation: float | None = None
    real_deviation: float | None = None

    @property
    def grows(self) -> bool:
        """Whether it grows beyond its 95 % interval, or beyond doubt where it has none."""
        return self.pole.real > self._doubt

    @property
    def decays(self) -> bool:
        """Whether it decays beyond its 95 % interval, or beyond doubt where it has none."""
        return -self.pole.real > self._doubt

    @property
    def _doubt(self) -> float:
        if self.real_deviation is None:
            return FAINT * abs(self.pole)
        return half_width() * self.real_deviation

    def __str__(self) -> str:
        """What it is, and how fast it grows or decays."""
        what = (
            "a motion" if self.pole.imag == 0.0 else f"an oscillation of {abs(self.pole):.3g} rad/s"
        )
        if self.pole.real == 0.0:
            return what
        word = "doubles" if self.pole.real > 0.0 else "halves"
        return f"{what} that {word} in {math.log(2.0) / abs(self.pole.real):.2g} s"


def poles_of(fit: Fit) -> tuple[FittedPole, ...]:
    """Poles of a fit that are not at rest; none where it has no linear system.

    Reference
    ---------
    Magnus, *Econometric Theory* 1 (1985): dλ = wᴴ dA v / wᴴ v of a simple eigenvalue.
    """
    try:
        system = linear_system(fit.model)
        matrix = np.asarray(system.a)
        values, vectors = np.linalg.eig(matrix)
        left = np.linalg.inv(vectors)
        uncertain = fit.uncertain()
        moves = None
        if uncertain.known:
            slopes = uncertain.slopes(lambda model: np.asarray(linear_system(model).a).ravel())
            moves = np.einsum("is,kst,ti->ik", left, slopes.reshape(-1, *matrix.shape), vectors)
    except (FlightidError, np.linalg.LinAlgError):
        return ()
    step = system.sample_time_s
    poles = values if step is None else np.log(np.where(values == 0.0, 1.0, values)) / step
    if moves is not None and step is not None:
        moves = moves / (step * np.where(values == 0.0, 1.0, values))[:, None]
    largest = float(np.max(np.abs(poles), initial=0.0))
    return tuple(
        _motion(complex(pole), None if moves is None else moves[place])
        for place, pole in enumerate(poles)
        if pole.imag >= 0.0 and abs(pole) > STILL * largest
    )


def _motion(pole: complex, moves: NDArray[np.complex128] | None) -> FittedPole:
    if moves is None or not np.all(np.isfinite(moves)):
        return FittedPole(pole)
    both = np.linalg.norm(np.array([moves.real, moves.imag]), axis=1)
    return FittedPole(pole, float(np.max(both)), float(both[0]))


def changed_growth(before: Sequence[FittedPole], after: Sequence[FittedPole]) -> str:
    """What grew for certain and grows no more, or began to; empty where that stays.

    Example
    -------
    >>> changed_growth([FittedPole(0.1 + 0.4j)], [FittedPole(-0.3 + 0.2j)])
    'an oscillation of 0.412 rad/s that doubles in 6.9 s would be gone'
    >>> changed_growth([FittedPole(-0.1 + 0.4j)], [FittedPole(0.1 + 0.4j)])
    'an oscillation of 0.412 rad/s that doubles in 6.9 s would come about'
    """
    for one, other, word in ((before, after, "be gone"), (after, before, "come about")):
        sure = [each for each in one if each.grows]
        if len(sure) > sum(each.pole.real > 0.0 for each in other):
            return f"{max(sure, key=lambda each: each.pole.real)} would {word}"
    return ""


def growth_findings(before: Sequence[FittedPole], after: Sequence[FittedPole]) -> list[Finding]:
    """Amber where a reduction has changed what grows, or lost modes beyond their intervals.

    Parameters
    ----------
    before, after : sequence of FittedPole
        Of the full fit and of the reduced one.
    """
    if not before or not after:
        return []
    said = [changed_growth(before, after).replace("would be gone", "is gone")]
    said = [each.replace("would come about", "has come about") for each in said if each]
    if (more := _moving(before) - _moving(after)) > 0:
        said.append(
            f"{more} pole{' has' if more == 1 else 's have'} come to rest: an integrator each"
        )
    said += [
        f"{each} has moved beyond its interval"
        for each in before
        if each.deviation is not None
        and min(abs(each.pole - other.pole) for other in after)
        > half_width(AMONG_THREE_HUNDRED) * each.deviation
    ]
    if not said:
        return []
    return [
        Finding(
            "reduction-changes-modes",
            Light.AMBER,
            f"the reduced model moves otherwise than the full one: {'; '.join(said)}",
            "keep the parameters that it hangs on (keep = [...]), or verify on long records",
        )
    ]


def _moving(poles: Sequence[FittedPole]) -> int:
    """Poles that are not at rest, those of a pair by themselves."""
    return sum(1 + (each.pole.imag > 0.0) for each in poles)
