"""Formulas of model files: grammar, derivatives, units; nothing runs, nothing hangs."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid import _native
from flightid.dimensions import require_unit
from flightid.errors import ModelError
from flightid.formula import formula_names
from tests.closeness import assert_close


def test_python_agrees_on_values_and_precedence() -> None:
    names = ["a", "b", "c"]
    values = np.array([1.3, 0.7, 2.1])
    a, b, c = values
    cases = {
        "-a^2 + b*c/a - 3e-1": -(a**2) + b * c / a - 0.3,
        "2^3^b - (a - b - c)": 2 ** (3**b) - (a - b - c),
        "atan2(a, b) + max(a, c)*min(b, c) + pi": np.arctan2(a, b) + c * b + np.pi,
        "exp(-a)*tanh(b) + sqrt(c)/log(c) + abs(-a) + sign(-b)": np.exp(-a) * np.tanh(b)
        + np.sqrt(c) / np.log(c)
        + a
        - 1,
    }
    found = _native.Tape(list(cases), names, {}).evaluate(values)
    assert_close(found, list(cases.values()), rtol=1e-14, why="same formulas in NumPy")


@given(st.lists(st.floats(0.2, 3.0), min_size=3, max_size=3))
def test_jacobian_matches_the_complex_step(point: list[float]) -> None:
    # A complex step has no cancellation, so it is exact to rounding.
    text = "sin(a*b)*exp(c/a) + a^b/(1 + c^2) + sqrt(a*c)*cosh(b) - tan(b/4)"

    def formula(a: complex, b: complex, c: complex) -> complex:
        return (
            np.sin(a * b) * np.exp(c / a)
            + a**b / (1 + c**2)
            + np.sqrt(a * c) * np.cosh(b)
            - np.tan(b / 4)
        )

    expected = []
    for k in range(3):
        step = np.array(point, dtype=complex)
        step[k] += 1e-30j
        expected.append(formula(*step).imag / 1e-30)
    found = _native.Tape([text], ["a", "b", "c"], {}).jacobian(np.array(point), [0, 1, 2])[0]
    assert_close(found, expected, rtol=1e-11, atol=1e-11, why="complex step is exact")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a +", "at character 3: found the end, needed a number"),
        ("__import__('os').system('x')", "needed"),
        ("foo(a)", "not a function known here"),
        ("sin(a, b)", "does not take 2"),
        ("(" * 100 + "a" + ")" * 100, "nested deeper than 64"),
        ("a" * 20_000, "longer than 10000 bytes"),
        ("1+" * 4_500 + "1", "more than 4096 terms"),
        ("1e999", "not a finite number"),
    ],
)
def test_faults_are_named(text: str, words: str) -> None:
    with pytest.raises(ModelError) as caught:
        formula_names(text)
    assert words in str(caught.value)


@given(st.text(max_size=200))
def test_any_text_parses_or_is_a_model_error(text: str) -> None:
    with contextlib.suppress(ModelError):
        formula_names(text)


def test_names_and_ties_are_checked() -> None:
    with pytest.raises(ModelError, match='"b" is not defined'):
        _native.Tape(["a*b"], ["a"], {})
    with pytest.raises(ModelError, match="definitions form a circle: x → y → x"):
        _native.Tape(["x"], ["a"], {"x": "y", "y": "x"})
    with pytest.raises(ValueError, match="inputs of the expressions: found 2, needed 1"):
        _native.Tape(["a"], ["a"], {}).evaluate(np.ones(2))
    with pytest.raises(ValueError, match="index of a direction"):
        _native.Tape(["a"], ["a"], {}).jacobian(np.ones(1), [1])
    with pytest.raises(ValueError, match="not finite"):
        _native.Tape(["log(a)"], ["a"], {}).evaluate(np.array([-1.0]))


@pytest.mark.parametrize(
    ("text", "unit"),
    [("1/T", "rad/s"), ("2*zeta*w", "1/s"), ("g*sin(phi)", "m/s^2"), ("sqrt(L*L)", "1/s^2")],
)
def test_units_that_agree(text: str, unit: str) -> None:
    units = {"T": "s", "zeta": "1", "w": "rad/s", "g": "m/s^2", "phi": "rad", "L": "1/s^2"}
    require_unit(text, unit, units, subject="it")


@pytest.mark.parametrize(
    ("text", "unit"),
    [("1 + T", "1"), ("T", "1/s"), ("sin(T)", "1"), ("d", "rad"), ("f + m", "ft"), ("5", "s")],
)
def test_units_that_clash(text: str, unit: str) -> None:
    units = {"T": "s", "d": "deg", "f": "ft", "m": "m"}
    with pytest.raises(ModelError, match="it does not have its unit"):
        require_unit(text, unit, units, subject="it")
