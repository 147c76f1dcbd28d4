"""Polynomial models as text: the difference equation, and the table of poles and zeros."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.models.polynomial.polynomials import Polynomials
from flightid.models.sampled.discrete_modes import discrete_modes, roots_table
from flightid.table import Table


def difference_equation(model: Polynomials) -> str:
    """The model in samples where it is ARX or ARMAX, else with its polynomials named."""
    if np.size(model.d) > 1 or any(np.size(row) > 1 for row in model.f):
        return _in_polynomials(model)
    terms = [(-x, f"{model.output}(t-{k})") for k, x in enumerate(np.asarray(model.a)[1:], 1)]
    for name, row, delay in zip(model.inputs, model.b, model.nk, strict=True):
        for k, x in enumerate(np.asarray(row), delay):
            terms.append((x, f"{name}(t-{k})" if k else f"{name}(t)"))
    tail = [(x, f"e(t-{k})") for k, x in enumerate(np.asarray(model.c)[1:], 1)]
    text = "".join(_term(value, word) for value, word in terms)
    text += " + e(t)" + "".join(_term(value, word) for value, word in tail)
    return f"{model.output}(t) = {text.removeprefix(' + ').removeprefix(' ')}"


def _term(value: float, word: str) -> str:
    return f" {'-' if value < 0 else '+'} {abs(value):.6g} {word}"


def _in_polynomials(model: Polynomials) -> str:
    parts = [
        f"{_quotient(row, k, f)} {name}(t)"
        for name, row, k, f in zip(model.inputs, model.b, model.nk, model.f, strict=True)
    ]
    noise = f"{_quotient(model.c, 0, model.d)} e(t)"
    left = "" if np.size(model.a) == 1 else f"[{_polynomial(model.a, 0)}] "
    return f"{left}{model.output}(t) = " + " + ".join([*parts, noise])


def _quotient(above: object, delay: int, below: object) -> str:
    """A polynomial over one that begins with 1, each in brackets where it has several terms."""
    upper, lower = _polynomial(above, delay), _polynomial(below, 0)
    upper, lower = (f"({each})" if np.asarray(row).size > 1 else each
                    for each, row in ((upper, above), (lower, below)))  # fmt: skip
    return f"[{upper} / {lower}]"


def _polynomial(row: object, delay: int) -> str:
    values = np.asarray(row, dtype=np.float64)
    words = [_term(value, f"q^-{k}" if k else "").rstrip() for k, value in enumerate(values, delay)]
    text = "".join(words).strip().removeprefix("+ ")
    return text or "0"


def factored(model: Polynomials, input: str) -> str:
    """The transfer function from an input in factors of z, powers of z that both have left out.

    Example
    -------
    >>> from flightid.models import PolynomialModel
    >>> factored(PolynomialModel(("u",), "y", 0.1, a=[1, -0.5], b=[[2.0, 1.0]], nk=(1,)), "u")
    'y/u = 2 (z + 0.5) / (z (z - 0.5))'
    """
    above, below = model.transfer(input)
    first = int(np.argmax(above != 0.0))
    zeros, poles = (np.roots(np.trim_zeros(row)).astype(complex) for row in (above, below))
    # z^-n beside monic polynomials of the degrees of both: what is left is a power of z.
    power = poles.size - zeros.size - first
    upper = f"{above[first]:.5g} {_powers(power)}{_factors(zeros)}".strip()
    lower = f"{_powers(-power)}{_factors(poles)}".strip()
    several = len(poles) - np.count_nonzero(poles.imag > 0.0) + (power < 0) > 1
    return f"{model.output}/{input} = {upper} / {f'({lower})' if several else lower or 1}"


def _powers(power: int) -> str:
    return "" if power <= 0 else f"z{'' if power == 1 else f'^{power}'} "


def _factors(roots: NDArray[np.complex128]) -> str:
    """Real roots, and pairs as ``(z² + b z + c)``."""
    said = [f"(z{_term(-root.real, '').rstrip()})" for root in roots if root.imag == 0.0]
    said += [
        f"(z²{_term(-2.0 * root.real, 'z')}{_term(abs(root) ** 2, '').rstrip()})"
        for root in roots
        if root.imag > 0.0
    ]
    return " ".join(said)


def polynomial_table(model: Polynomials) -> Table:
    """Poles and zeros of each response, with equation, steady gains and delays."""
    found = zip(model.poles().items(), model.zeros().values(), strict=True)
    notes = (
        difference_equation(model),
        *(factored(model, name) for name in model.inputs),
        "steady gains: "
        + ", ".join(
            f"{name} {'none (integrator)' if gain is None else f'{gain:.5g}'}"
            for name, gain in model.gains().items()
        ),
        f"delays: {', '.join(f'{k} samples' for k in model.nk)}",
    )
    return roots_table(
        repr(model),
        [
            (response, discrete_modes(poles, model.sample_time_s), zeros)
            for (response, poles), zeros in found
        ],
        notes,
    )
