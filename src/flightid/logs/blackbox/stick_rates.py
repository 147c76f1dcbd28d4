"""Rate set-points of the sticks, where a blackbox logged none: the firmware's own curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
FULL_STICK, FASTEST_DEG_S = 500.0, 1998.0
"""rcCommand at full deflection; no curve asks for more than that rate."""
AXES = range(3)
BORNE_OUT = 0.9
"""Least share of the P terms' squares that set-points less rates must explain."""


def _expo(stick: Array, power: Array, share: float) -> Array:
    return stick * power * share + stick * (1.0 - share)


def _super(size: Array, share: float) -> Array:
    return 1.0 / np.clip(1.0 - size * share, 0.01, 1.0)


def _betaflight(stick: Array, rc_rate: float, rate: float, expo: float) -> Array:
    size = np.abs(stick)
    slope = rc_rate / 100.0
    slope += 14.54 * max(slope - 2.0, 0.0)
    return 200.0 * slope * _expo(stick, size**3, expo / 100.0) * _super(size, rate / 100.0)


def _raceflight(stick: Array, rc_rate: float, rate: float, expo: float) -> Array:
    curved = (1.0 + 0.01 * expo * (stick**2 - 1.0)) * stick
    return 10.0 * rc_rate * curved * (1.0 + 0.01 * rate * np.abs(stick))


def _early_raceflight(stick: Array, rc_rate: float, rate: float, expo: float) -> Array:
    curved = (1.0 + 0.01 * expo * (stick**2 - 1.0)) * stick
    return 10.0 * rc_rate * curved * (1.0 + 0.01 * rate)


def _kiss(stick: Array, rc_rate: float, rate: float, expo: float) -> Array:
    curved = _expo(stick, stick**2, expo / 100.0) * rc_rate / 1000.0
    return 2000.0 * curved * _super(np.abs(stick), rate / 100.0)


def _actual(stick: Array, rc_rate: float, rate: float, expo: float) -> Array:
    beyond = max(0.0, 10.0 * (rate - rc_rate))
    return 10.0 * rc_rate * stick + beyond * np.abs(stick) * _expo(stick, stick**4, expo / 100.0)


def _quick(stick: Array, rc_rate: float, rate: float, expo: float) -> Array:
    centre = 2.0 * max(rc_rate, 1.0)
    most = max(10.0 * rate, centre)
    size = np.abs(stick)
    curve = _expo(size, size**2, expo / 100.0)
    return stick * centre * _super(curve, 1.0 - centre / most)


def _quick_with_expo(stick: Array, rc_rate: float, rate: float, expo: float) -> Array:
    centre = 2.0 * max(rc_rate, 1.0)
    most = max(10.0 * rate, centre)
    curved = _expo(stick, stick**2, expo / 100.0)
    return curved * centre * _super(np.abs(stick), 1.0 - centre / most)


CURVES: Mapping[str, tuple[Callable[[Array, float, float, float], Array], ...]] = {
    "Betaflight": (_betaflight,),
    "RaceFlight": (_raceflight, _early_raceflight),
    "KISS": (_kiss,),
    "Actual": (_actual,),
    "Quick": (_quick, _quick_with_expo),
}
"""By ``rates_type``, in its order. RaceFlight's grew with the stick only later, and the header does
not tell ``quickrates_rc_expo``."""


@dataclass(frozen=True, eq=False)
class StickRates:
    """Set-points that were made from sticks.

    Attributes
    ----------
    curve : str
        Name of the firmware's curve.
    set_points : ndarray, shape (3, n)
        deg/s, in the firmware's signs.
    explained : float
        Share of the P terms' squares that set-points less rates explain, of the worst axis.
    """

    curve: str
    set_points: Array
    explained: float

    @property
    def is_borne_out(self) -> bool:
        """Whether the controller's own P terms show that these were its set-points."""
        return self.explained >= BORNE_OUT


def stick_rate(curve: str, stick: Array, rc_rate: float, rate: float, expo: float) -> Array:
    """Rate that a stick asks for, deg/s.

    Parameters
    ----------
    curve : str
        A name of `CURVES`.
    stick : ndarray
        Deflection from -1 to 1.
    rc_rate, rate, expo : float
        The header's numbers, as they stand there.

    Reference
    ---------
    Betaflight, src/main/fc/rc.c, applyBetaflightRates and the others (3.0 to 2025.12).

    Example
    -------
    >>> stick_rate("Betaflight", np.array([0.5, -1.0]), 100, 70, 0).round(1).tolist()
    [153.8, -666.7]
    >>> stick_rate("Actual", np.array([1.0]), 7, 67, 54).tolist()
    [670.0]
    """
    asked = CURVES[curve][0](np.asarray(stick, dtype=np.float64), rc_rate, rate, expo)
    return np.clip(asked, -FASTEST_DEG_S, FASTEST_DEG_S)


def stick_rates(
    sticks: Array, rates_deg_s: Array, p_terms: Array, settings: Mapping[str, float]
) -> StickRates | None:
    """Set-points by the curve that the P terms of the controller bear out best.

    Parameters
    ----------
    sticks : ndarray, shape (3, n)
        rcCommand of roll, pitch and yaw.
    rates_deg_s, p_terms : ndarray, shape (3, n)
        What the controller measured, and its P terms.
    settings : mapping of str to float
        The header. Where it has no ``rates_type``, all curves are tried.

    Returns
    -------
    StickRates or None
        None where the header tells no rates, or no P term moves.

    Assumes
    -------
    One rate profile in the whole log, and rates asked for by sticks alone (no levelling): P terms
    are in proportion to set-point less rate then, up to what throttle makes of P.
    """
    told = [_told(settings, axis) for axis in AXES]
    if None in told or not np.any(p_terms[:2]):
        return None
    names = list(CURVES)
    kind = settings.get("rates_type")
    tried = names if kind is None else names[int(kind) : int(kind) + 1]
    made = [
        _judged(name, curve, sticks / FULL_STICK, rates_deg_s, p_terms, [t for t in told if t])
        for name in tried
        for curve in CURVES[name]
    ]
    return max(made, key=lambda each: each.explained, default=None)


def _told(settings: Mapping[str, float], axis: int) -> tuple[float, float, float] | None:
    """rc_rate, rate and expo of an axis, under the names of newer or older headers."""
    yaw = "_yaw" if axis == 2 else ""
    old = {"rc_rates": (f"rc_rate{yaw}",), "rc_expo": ("rc_yaw_expo",) if yaw else ("rc_expo",)}
    found = [
        next((settings[n] for n in (f"{name}[{axis}]", *old.get(name, ())) if n in settings), None)
        for name in ("rc_rates", "rates", "rc_expo")
    ]
    rc_rate, rate, expo = found
    if rc_rate is None or rate is None or expo is None:
        return None
    return rc_rate, rate, expo


def _judged(
    name: str,
    curve: Callable[[Array, float, float, float], Array],
    sticks: Array,
    rates_deg_s: Array,
    p_terms: Array,
    told: list[tuple[float, float, float]],
) -> StickRates:
    asked = np.array([curve(sticks[axis], *told[axis]) for axis in AXES])
    set_points = np.clip(asked, -FASTEST_DEG_S, FASTEST_DEG_S)
    shares = [
        _explained(set_points[axis] - rates_deg_s[axis], p_terms[axis])
        for axis in AXES
        if np.any(p_terms[axis])
    ]
    return StickRates(name, set_points, min(shares))


def _explained(error: Array, p_term: Array) -> float:
    """Share of the P term's squares that the error in proportion explains."""
    both = float(error @ p_term)
    return both * abs(both) / max(float(error @ error) * float(p_term @ p_term), 1e-300)
