"""Units that are told without pint: the same words, factors and verdicts as pint's."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

from flightid import units
from flightid.common_units import SHORT, SYMBOLS, common_unit

WRITTEN = [
    "1",
    *SHORT,
    *SYMBOLS,
    *(f"1/{symbol}^{power}" for symbol in SYMBOLS for power in (2, 3)),
    *(f"{a}/{b}" for a, b in product(SYMBOLS, SYMBOLS) if a != b),
    *(f"{a}*{b}" for a, b in product(SYMBOLS, SYMBOLS)),
    *(f"{a}*{b}/{c}^2" for a, b, c in product(("ft", "kg", "rad"), ("m", "s"), ("deg", "s"))),
    *(f"{a}/{b}/{c}" for a, b, c in product(("ft", "rad"), ("deg", "ft", "s^2"), ("in", "s"))),
]
TOLD = [text for text in WRITTEN if common_unit(text) is not None]
VERBS = (units.canonical, units.exponents, units.si_base, units.is_convertible)


@pytest.fixture
def by_pint(monkeypatch: pytest.MonkeyPatch) -> Callable[..., object]:
    def ask(verb: Callable[..., object], *texts: str) -> object:
        plain = getattr(verb, "__wrapped__", verb)
        with monkeypatch.context() as patch:
            patch.setattr(units, "common_unit", lambda text: None)
            for each in VERBS:
                each.cache_clear()
            found = plain(*texts)
        for each in VERBS:
            each.cache_clear()
        return found

    return ask


def test_each_unit_is_what_pint_says(by_pint: Callable[..., object]) -> None:
    assert len(TOLD) > 150
    for text in TOLD:
        for verb in (units.canonical, units.exponents, units.si_base):
            assert verb(text) == by_pint(verb, text), (verb.__name__, text)


def test_pairs_are_what_pint_says(by_pint: Callable[..., object]) -> None:
    some = [
        "N",
        "kg*m/s^2",
        "rad",
        "deg",
        "1",
        "rad/s",
        "1/s",
        "deg/s",
        "ft",
        "m",
        *SHORT,
        "µs",
        "s",
        "g",
    ]
    for first, second in product(some, some):
        for verb in (units.match, units.same_dimension, units.is_convertible):
            assert verb(first, second) == by_pint(verb, first, second), (first, second)
        if by_pint(units.same_dimension, first, second):
            ours = units.convert([1.0, -3.0], first, second)
            np.testing.assert_allclose(
                ours, by_pint(units.convert, [1.0, -3.0], first, second), rtol=1e-15
            )


@pytest.mark.parametrize(
    "text", ["rad/sec", "s*rad", "rad/s/ft", "ft*ft", "", "g", "m^", "1/", "/s"]
)
def test_other_spellings_are_left_to_pint(text: str) -> None:
    assert common_unit(text) is None
