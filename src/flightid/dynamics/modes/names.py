"""Words for modes, from how states take part in them and what the states are called."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.dynamics.modes.participation import Eigenpair
from flightid.frozen import dataclass
from flightid.units import same_dimension

LIGHT = 0.3
"""Damping ratio below which an oscillation is lightly damped."""
HEAVY = 0.9
"""Damping ratio above which it is nearly critically damped."""
SHOWN = 0.1
"""Least participation of a state that the words mention."""
PARTNER = 0.25
"""Least participation of a second state in the name of an aperiodic mode."""
ROTOR = 0.3
"""Least participation of flapping in a mode that belongs to the rotor."""
SIDED = 2.0
"""Ratio above which one axis dominates another."""


@dataclass(frozen=True)
class StateWord:
    """What a state is.

    Attributes
    ----------
    word : str
        For a sentence.
    kind : {"speed", "flow", "rate", "attitude", "rotor", "bar", "feedback", "lag"}
        ``flow``: angle of the air, which a speed would be in other coordinates.
    axis : {"longitudinal", "lateral", "directional", "heave", ""}

    Example
    -------
    >>> word_of("q", "rad/s").word
    'pitch rate'
    """

    word: str
    kind: str
    axis: str


_SIZES = {
    "speed": "m/s", "flow": "rad", "rate": "rad/s", "attitude": "rad", "rotor": "rad", "bar": "rad",
}  # fmt: skip
_NAMES: Mapping[str, StateWord] = {
    name: StateWord(word, kind, axis)
    for names, word, kind, axis in (
        ("u", "forward speed", "speed", "longitudinal"),
        ("V Va airspeed", "airspeed", "speed", "longitudinal"),
        ("v", "sideward speed", "speed", "lateral"),
        ("w", "vertical speed", "speed", "heave"),
        ("alpha", "angle of attack", "flow", "longitudinal"),
        ("beta", "sideslip", "flow", "lateral"),
        ("p", "roll rate", "rate", "lateral"),
        ("q", "pitch rate", "rate", "longitudinal"),
        ("r", "yaw rate", "rate", "directional"),
        ("phi", "roll attitude", "attitude", "lateral"),
        ("theta", "pitch attitude", "attitude", "longitudinal"),
        ("psi", "heading", "attitude", "directional"),
        ("a a1 a1s beta1c betac", "longitudinal flapping", "rotor", "longitudinal"),
        ("b b1 b1s beta1s betas", "lateral flapping", "rotor", "lateral"),
        ("c", "longitudinal bar flapping", "bar", "longitudinal"),
        ("d", "lateral bar flapping", "bar", "lateral"),
        ("rfb", "gyro feedback", "feedback", "directional"),
        ("inflow nu lambda0", "inflow", "lag", "heave"),
    )
    for name in names.split()
}


def word_of(name: str, unit: str) -> StateWord:
    """What a state is, by its name where its unit agrees, and by its unit otherwise.

    Parameters
    ----------
    name, unit : str

    Example
    -------
    >>> word_of("b", "rad").word, word_of("b", "m/s").word
    ('lateral flapping', 'speed b')
    """
    known = _NAMES.get(name)
    if known is not None and _fits(known, unit):
        return known
    for kind, size in (("rate", "rad/s"), ("speed", "m/s")):
        if same_dimension(unit, size):
            return StateWord(f"{kind} {name}", kind, "")
    return StateWord(name, "lag", "")


def _fits(word: StateWord, unit: str) -> bool:
    size = _SIZES.get(word.kind)
    return size is None or same_dimension(unit, size)


@dataclass(frozen=True)
class NamedMode:
    """A mode's name, its character and what takes part in it.

    Example
    -------
    >>> str(NamedMode("phugoid", "unstable oscillation", "pitch attitude 50 %"))
    'phugoid, unstable oscillation: pitch attitude 50 %'
    """

    name: str
    character: str
    parts: str

    def __str__(self) -> str:
        """One line."""
        return f"{self.name}, {self.character}" + (f": {self.parts}" if self.parts else "")


def character_of(value: complex | None) -> str:
    """How an eigenvalue moves, in words.

    Parameters
    ----------
    value : complex or None
        rad/s; None for a discrete pole without a continuous counterpart.

    Example
    -------
    >>> character_of(-1 + 8j), character_of(0.2 + 0j), character_of(0j)
    ('lightly damped oscillation', 'divergence', 'integrator')
    """
    if value is None:
        return "alternates from sample to sample"
    if value == 0.0:
        return "integrator"
    if not value.imag:
        return "subsidence" if value.real < 0.0 else "divergence"
    damping = -value.real / abs(value)
    if damping < 0.0:
        return "unstable oscillation"
    if damping < LIGHT:
        return "lightly damped oscillation"
    return "nearly critically damped oscillation" if damping > HEAVY else "damped oscillation"


def name_by_states(
    value: complex | None, pair: Eigenpair, names: Sequence[str], units: Mapping[str, str]
) -> NamedMode:
    """Name a mode of a model whose states mean something.

    Parameters
    ----------
    value : complex or None
        rad/s.
    pair : Eigenpair
        Its participation factors and shape.
    names : sequence of str
        Of the states; conventional ones are understood.
    units : mapping of str to str
        Of the states.
    """
    words = [word_of(name, units.get(name, "1")) for name in names]
    shares = pair.shares
    if not len(shares):
        return NamedMode("chain of integrators", character_of(value), "")
    weights = _Weights(words, shares, {name: abs(z) for name, z in zip(names, pair.vector)})  # noqa: B905
    name = _pair_name(weights) if pair.is_pair else _real_name(weights, value)
    order = [k for k in np.argsort(-shares) if shares[k] >= SHOWN]
    parts = [f"{words[k].word} {100.0 * shares[k]:.0f} %" for k in order]
    return NamedMode(name, character_of(value), ", ".join(parts) + weights.rates())


def name_by_outputs(value: complex | None, outputs: Iterable[str]) -> NamedMode:
    """Name a mode of a black box by what it is seen in.

    Parameters
    ----------
    value : complex or None
        rad/s.
    outputs : iterable of str
        Outputs that show the mode.

    Example
    -------
    >>> print(name_by_outputs(-5.0 + 0j, ["p"]))
    p, subsidence
    """
    return NamedMode(" and ".join(outputs) or "no output", character_of(value), "")


class _Weights:
    """Participation by kind and axis."""

    def __init__(
        self, words: Sequence[StateWord], shares: NDArray[np.float64], sizes: Mapping[str, float]
    ) -> None:
        self.words, self.shares = words, shares
        self.sizes = dict(sizes)
        self.present = set(sizes)

    def share(self, *kinds: str, axis: str | None = None) -> float:
        return float(
            sum(
                share
                for word, share in zip(self.words, self.shares, strict=True)
                if word.kind in kinds and axis in (None, word.axis)
            )
        )

    def of(self, *words: str) -> float:
        return float(
            sum(
                share
                for word, share in zip(self.words, self.shares, strict=True)
                if word.word in words
            )
        )

    def leading(self) -> list[StateWord]:
        order = np.argsort(-self.shares)
        return [self.words[k] for n, k in enumerate(order) if n == 0 or self.shares[k] >= PARTNER][
            :2
        ]

    def turning(self) -> str:
        """Axis of the largest angular rate in the shape."""
        rates = {"roll": "p", "pitch": "q", "yaw": "r"}
        return max(rates, key=lambda axis: self.sizes.get(rates[axis], 0.0))

    def rates(self) -> str:
        """How the angular rates share an oscillation of the vehicle, against the largest."""
        if self.share("rate") < SHOWN:
            return ""
        shown = {"p": "roll rate", "q": "pitch rate", "r": "yaw rate"}
        sizes = {word: self.sizes[name] for name, word in shown.items() if name in self.sizes}
        top = max(sizes, key=lambda word: sizes[word], default="")
        rest = [
            f"{word} {100.0 * size / sizes[top]:.0f} %"
            for word, size in sizes.items()
            if word != top and size >= SHOWN * sizes[top]
        ]
        return f"; {' and '.join(rest)} of {top}" if rest else ""


def _pair_name(found: _Weights) -> str:
    if found.share("rotor", "bar") >= ROTOR:
        return _flapping_name(found)
    if found.share("feedback") >= PARTNER and found.of("yaw rate") >= PARTNER:
        return "yaw/gyro-feedback"
    flying = {"sideward speed"}.isdisjoint(word.word for word in found.words)
    if found.of("angle of attack", "vertical speed") >= PARTNER and found.of("pitch rate") >= SHOWN:
        return "short period"
    yawing = found.of("yaw rate") >= PARTNER
    if yawing and found.of("sideslip", "sideward speed") >= PARTNER:
        return "Dutch roll"
    slow = found.share("speed") + found.share("attitude")
    if slow >= 0.5 and found.share("speed") >= SHOWN and found.share("attitude") >= SHOWN:
        return "phugoid" if flying else f"{_side(found)}phugoid-like"
    return " and ".join(word.word for word in found.leading())


def _side(found: _Weights) -> str:
    along = found.share("speed", "attitude", "rate", axis="longitudinal")
    across = found.share("speed", "attitude", "rate", axis="lateral")
    if along > SIDED * across:
        return "longitudinal "
    return "lateral " if across > SIDED * along else "coupled "


def _flapping_name(found: _Weights) -> str:
    along = found.share("rotor", "bar", axis="longitudinal")
    across = found.share("rotor", "bar", axis="lateral")
    flapping = "coupled" if max(along, across) < SIDED * min(along, across) else ""
    if not flapping:
        flapping = "longitudinal" if along > across else "lateral"
    bar = " with stabilizer bar" if found.share("bar") >= SHOWN else ""
    return f"{found.turning()}/{flapping}-flapping{bar}"


_REAL_NAMES = {
    "roll rate": "roll",
    "pitch rate": "pitch",
    "yaw rate": "yaw",
    "vertical speed": "heave",
    "forward speed": "speed",
    "airspeed": "speed",
}


def _real_name(found: _Weights, value: complex | None) -> str:
    first, *others = found.leading()
    sideways = {"sideslip", "sideward speed"} & {word.word for word in found.words}
    turning = first.word == "roll attitude" and sideways and "r" in found.present
    if turning and value != 0.0:
        return "spiral"
    return " and ".join(_REAL_NAMES.get(word.word, word.word) for word in (first, *others))
