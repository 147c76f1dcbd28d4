"""Textbook approximations of modes, as rules: which states, which formula, whose."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
Roots = NDArray[np.complex128]

NELSON_ALONG = "Nelson, Flight Stability and Automatic Control, 2nd ed., sec. 4.4"
NELSON_ACROSS = "Nelson, Flight Stability and Automatic Control, 2nd ed., sec. 5.4"
ETKIN = "Etkin and Reid, Dynamics of Flight, 3rd ed., sec. 6.8"
MCRUER = "McRuer, Ashkenas and Graham, Aircraft Dynamics and Automatic Control, ch. 5"
JOHNSON = "Johnson, Helicopter Theory, sec. 15-3 (hover)"


class Elements:
    """Entries of the state matrix by conventional names, ``w`` for alpha and ``v`` for beta too.

    Determinants and traces of blocks do not depend on whether a flow angle or a speed is the state.

    Example
    -------
    >>> e = Elements(np.array([[-2.0, 1.0], [-8.0, -3.0]]), ["w", "q"])
    >>> e["q", "w"], e.block("wq").shape
    (np.float64(-8.0), (2, 2))
    """

    def __init__(self, a: Array, names: list[str]) -> None:
        self.a, self.names = a, names

    def __getitem__(self, pair: tuple[str, str]) -> float:
        row, column = (self.names.index(name) for name in pair)
        return self.a[row, column]  # type: ignore[no-any-return]

    def block(self, names: str, others: str = "") -> Array:
        """Square block of some states, or their rows and the columns of others."""
        rows = [self.names.index(_LONG.get(name, name)) for name in names]
        columns = [self.names.index(_LONG.get(name, name)) for name in others or names]
        return np.asarray(self.a[np.ix_(rows, columns)])


_LONG = {"θ": "theta", "φ": "phi"}


@dataclass(frozen=True)
class Rule:
    """One approximation.

    Attributes
    ----------
    name : str
        Of the mode.
    states : tuple of str
        States that it needs, conventional; the full model's mode has most of its participation in
        `carriers`.
    carriers : tuple of str
    formula, source : str
        In conventional derivatives, and where it is derived.
    roots : callable
        From the elements to the roots, rad/s.
    flight : {"forward", "hover"}
    pair : bool
        Whether a complex pair is meant, or a real root.

    Example
    -------
    >>> [rule.name for rule in RULES if rule.flight == "hover"][:2]
    ['hovering cubic, longitudinal: oscillation', 'hovering cubic, longitudinal: pitch']
    """

    name: str
    states: tuple[str, ...]
    carriers: tuple[str, ...]
    formula: str
    source: str
    roots: Callable[[Elements], Roots]
    flight: str
    pair: bool

    def root(self, elements: Elements) -> complex:
        """The root meant: the upper one of the pair or the real one; NaN where there is none."""
        found = self.roots(elements)
        if not np.all(np.isfinite(found)):
            return complex(np.nan, np.nan)
        real = np.abs(found.imag) <= 1e-9 * np.abs(found)
        meant = found[(found.imag > 0.0) & ~real] if self.pair else found[real]
        if not len(meant):
            return complex(np.nan, np.nan)
        return complex(meant[np.argmax(np.abs(meant))])


def _of(block: Array) -> Roots:
    return np.asarray(np.linalg.eigvals(block), dtype=np.complex128)


def _one(value: float) -> Roots:
    return np.array([value], dtype=np.complex128)


def _quadratic(twice: float, square: float) -> Roots:
    if not np.isfinite(square):
        return _one(np.nan)
    return np.asarray(np.roots([1.0, twice, square]), dtype=np.complex128)


def _lanchester(e: Elements) -> Roots:
    return _quadratic(-e["u", "u"], _ratio(e["u", "theta"] * e["w", "u"], e["w", "q"]))


def _quasi_static(e: Elements) -> Roots:
    follows = np.linalg.solve(e.block("wq"), e.block("wq", "uθ"))
    return _of(e.block("uθ") - e.block("uθ", "wq") @ follows)


def _last_two(e: Elements) -> Roots:
    coefficients = np.poly(e.block("vprφ"))
    return _one(_ratio(-coefficients[4], coefficients[3]))


def _spiral(e: Elements) -> Roots:
    return _one(_ratio(e["r", "r"] * e["p", "v"] - e["r", "v"] * e["p", "r"], e["p", "v"]))


def _ratio(above: float, below: float) -> float:
    return above / below + 0.0 if below else np.nan


def _hover_rules(side: str, states: str, formula: str, turn: str) -> tuple[Rule, ...]:
    speed, rate, attitude = (_LONG.get(name, name) for name in states)
    needed = (speed, rate, attitude)
    return tuple(
        Rule(
            f"hovering cubic, {side}: {name}",
            needed,
            carriers,
            formula,
            JOHNSON,
            lambda e: _of(e.block(states)),
            "hover",
            pair,
        )
        for name, carriers, pair in (
            ("oscillation", (speed, attitude, rate), True),
            (turn, (rate, speed, attitude), False),
        )
    )


RULES: tuple[Rule, ...] = (
    Rule(
        "short period", ("w", "q"), ("w", "q"),
        "ω² = Zw Mq − Mw (U0 + Zq), 2ζω = −(Zw + Mq + U0 Mẇ)", NELSON_ALONG,
        lambda e: _of(e.block("wq")), "forward", True,
    ),
    Rule(
        "phugoid", ("u", "w", "q", "theta"), ("u", "theta"),
        "ω² = −g Zu/U0, 2ζω = −Xu", f"{NELSON_ALONG} (after Lanchester)",
        _lanchester, "forward", True,
    ),
    Rule(
        "phugoid, quasi-static short period", ("u", "w", "q", "theta"), ("u", "theta"),
        "A11 − A12 A22⁻¹ A21 of (u, θ) with ẇ = q̇ = 0", MCRUER,
        _quasi_static, "forward", True,
    ),
    Rule(
        "roll", ("p", "r", "v"), ("p",), "λ = Lp", NELSON_ACROSS,
        lambda e: _one(e["p", "p"]), "forward", False,
    ),
    Rule(
        "spiral", ("v", "p", "r", "phi"), ("phi", "r", "v"),
        "λ = (Lβ Nr − Nβ Lr)/Lβ", NELSON_ACROSS, _spiral, "forward", False,
    ),
    Rule(
        "spiral, last two coefficients", ("v", "p", "r", "phi"), ("phi", "r", "v"),
        "λ = −E/D of A s⁴ + B s³ + C s² + D s + E", ETKIN, _last_two, "forward", False,
    ),
    Rule(
        "Dutch roll", ("v", "r"), ("v", "r"),
        "ω² = Nβ + (Yβ Nr − Nβ Yr)/U0, 2ζω = −(Yβ/U0 + Nr)", NELSON_ACROSS,
        lambda e: _of(e.block("vr")), "forward", True,
    ),
    *_hover_rules(
        "longitudinal", "uqθ",
        "s³ − (Xu + Mq) s² + (Xu Mq − Xq Mu) s + g Mu = 0", "pitch",
    ),
    *_hover_rules(
        "lateral", "vpφ",
        "s³ − (Yv + Lp) s² + (Yv Lp − Yp Lv) s − g Lv = 0", "roll",
    ),
    Rule("heave", ("w",), ("w",), "λ = Zw", JOHNSON, lambda e: _one(e["w", "w"]), "hover", False),
    Rule("yaw", ("r",), ("r",), "λ = Nr", JOHNSON, lambda e: _one(e["r", "r"]), "hover", False),
)  # fmt: skip
"""All approximations; those whose states a model has are tried."""

RIGID = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")
"""States of a rigid vehicle; all others are taken as quasi-static."""
ALIASES: Mapping[str, str] = {"alpha": "w", "beta": "v", "V": "u", "Va": "u", "airspeed": "u"}


def rigid(a: Array, names: tuple[str, ...]) -> Elements:
    """Elements of the rigid vehicle, other states quasi-static.

    Parameters
    ----------
    a : ndarray, shape (n, n)
    names : tuple of str
        Conventional names of the states.

    Returns
    -------
    Elements
        NaN where the other states have no quasi-static value.

    Example
    -------
    >>> a = np.array([[0.0, 100.0], [-1.0, -20.0]])  # p' = Lb b, tau b' = -tau p - b
    >>> rigid(a, ("p", "b")).a
    array([[-5.]])
    """
    short = [ALIASES.get(name, name) for name in names]
    kept = [k for k, name in enumerate(short) if name in RIGID]
    rest = [k for k in range(len(short)) if k not in kept]
    slow = a[np.ix_(kept, kept)]
    if rest:
        fast = a[np.ix_(rest, rest)]
        if np.linalg.cond(fast) > 1e12:
            slow = np.full_like(slow, np.nan)
        else:
            across = np.linalg.solve(fast, a[np.ix_(rest, kept)])
            slow = slow - a[np.ix_(kept, rest)] @ across
    return Elements(slow, [short[k] for k in kept])
