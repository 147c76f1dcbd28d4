"""Denominators drawn at any rate, each with the numerators that fit best: starts of a search.

Regressions in lags of the output know a mode that is slow against the sample badly where there is
noise, and searches from all of them end at one wrong minimum. What a denominator can do is told by
one regression on the inputs that went through it, for which no slope is needed.

Reference: Golub & Pereyra (1973), SIAM J. Numer. Anal. 10 (separable least squares).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.identification.prediction_error.linear_regression import regress
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.recursive_filter import filtered

Array = NDArray[np.float64]
Rows = list[Array]

DRAWN = 8
"""Denominators drawn for each that is kept: 8 as 32 of them left no wrong minimum of 240 fits, of
which regressions alone had left 26."""
FASTEST = 2.0
"""Largest natural frequency of a drawn mode, rad per sample; the smallest is one per record."""
PAIRS = 0.6
"""Share of pairs of complex roots among what is drawn while two roots are left."""
DAMPING = 0.05, 1.0
"""Of drawn pairs, between these."""


def drawn_plant(
    structure: PolynomialStructure, data: SampledChannels, generator: np.random.Generator
) -> tuple[Rows, Rows]:
    """B of each input and each F that is fitted, the best of those drawn."""
    slowest = 1.0 / max(data.lengths)
    found = []
    for _ in range(DRAWN):
        below = [_denominator(generator, degree, slowest) for degree in structure.degrees_of_f]
        made = regress(
            data.output,
            _through(data, below),
            data.lengths,
            0,
            structure.nb,
            structure.nk,
            skip=0,
            levels=data.levels,
        )
        if np.all(np.isfinite(made.triangle)):
            found.append((made.sum_of_squares, made.shortest, below))
    if not found:
        return [np.zeros(n) for n in structure.nb], [np.zeros(n) for n in structure.degrees_of_f]
    _, best, below = min(found, key=lambda each: each[0])
    return list(np.split(best, np.cumsum(structure.nb)[:-1])), below


def _through(data: SampledChannels, below: Rows) -> Array:
    """Inputs of each record through the denominators, at rest before it."""
    each = below if len(below) == len(data.inputs) else below * len(data.inputs)
    rows = np.empty_like(data.inputs)
    for span in data.spans:
        for row, source, f in zip(rows, data.inputs, each, strict=True):
            row[span] = filtered([1.0], np.concatenate([[1.0], f]), source[span])
    return rows


def _denominator(generator: np.random.Generator, degree: int, slowest: float) -> Array:
    """Coefficients after the leading one, of stable roots whose rates are drawn by octaves."""
    roots: list[complex] = []
    while len(roots) < degree:
        rate = np.exp(generator.uniform(np.log(slowest), np.log(FASTEST)))
        if degree - len(roots) > 1 and generator.random() < PAIRS:
            damping = generator.uniform(*DAMPING)
            root = np.exp(rate * complex(-damping, np.sqrt(1.0 - damping**2)))
            roots += [root, root.conjugate()]
        else:
            roots.append(complex(np.exp(-rate)))
    return np.asarray(np.real(np.poly(roots)))[1:] if degree else np.zeros(0)
