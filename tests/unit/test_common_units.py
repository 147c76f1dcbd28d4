"""Units that are told without pint: the same words, factors and verdicts as pint's."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

from flightid import units
from flightid.common_units import SHORT, SYMBOLS, common_unit
from flightid.dynamics.derivatives.derivatives import derivatives
from flightid.models import load_model

WRITTEN = [
    "1",
    *SHORT,
    *SYMBOLS,
    *(f"1/{symbol}^{power}" for symbol in SYMBOLS for power in (2, 3)),
    *(f"{a}/{b}" for a, b in product(SYMBOLS, SYMBOLS) if a != b),
    *(f"{a}*{b}" for a, b in product(SYMBOLS, SYMBOLS)),
    *(f"{a}*{b}/{c}^2" for a, b, c in product(("ft", "kg", "rad"), ("m", "s"), ("deg", "s"))),
    *(f"{a}/{b}/{c}" for a, b, c in product(("ft", "rad"), ("deg", "ft", "s^2"), ("in", "s"))),
    *(
        f"({a})/({b})"
        for a, b in product(("1", "rad", "rad/s", "m*N", "radian/second"), ("s", "N", "rad"))
    ),
    *(f"{a}/({b}^2*{c})^2*{a}" for a, b, c in product(("ft", "rad"), ("s", "m"), ("kg", "s"))),
    "rad/(s^2*in)",
    "N*m*s",
    "s/s",
    "1/s^2 / (m/s) * s",
    "(deg/s)*(s/deg)",
    "1/(ft*s)*1^2",
    "((m))/((s/(kg)))",
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
    assert len(TOLD) == len(WRITTEN) > 250
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
        "(rad) / (s)",
    ]
    for first, second in product(some, some):
        for verb in (units.match, units.same_dimension, units.is_convertible):
            assert verb(first, second) == by_pint(verb, first, second), (first, second)
        if by_pint(units.same_dimension, first, second):
            ours = units.convert([1.0, -3.0], first, second)
            np.testing.assert_allclose(
                ours, by_pint(units.convert, [1.0, -3.0], first, second), rtol=1e-15
            )


def test_other_spellings_are_left_to_pint() -> None:
    others = [
        "rad/sec",
        "rad s",
        "m^-1",
        "",
        "g",
        "m^",
        "m  *s",
        "1/",
        "/s",
        "(m",
        "m)",
        "()",
        "2*m",
        "m^2^3",
    ]
    assert not [text for text in (*others, "m" + 30 * "*m") if common_unit(text) is not None]


def test_no_model_of_the_library_asks_pint(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loading it took 2.5 s of a study of the R-50 or the AH-64: `1/(ft*s)` was its to read."""

    def refuse(*_: object) -> None:
        raise AssertionError("pint is asked")

    for each in (*VERBS, units._parse):
        each.cache_clear()
    monkeypatch.setattr(units, "_registry", refuse)
    for name in ("r50_hover", "ah64_hover", "fixed_wing_lateral"):
        model = load_model(name)
        assert derivatives(model).summary().rows
