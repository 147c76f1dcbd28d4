"""Starts of a prediction-error fit: two-stage least squares, reduced and drawn plants, noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.frozen import dataclass
from flightid.identification.prediction_error.drawn_denominators import drawn_plant
from flightid.identification.prediction_error.linear_regression import (
    reflected,
    regress,
    regress_structure,
)
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.recursive_filter import filtered

Array = NDArray[np.float64]
SYSTEMATIC = 3
"""Plants that noise models are found for, one with drawn denominators among them."""
LONG = 5000
"""Samples from which denominators are drawn only where more starts are asked for: of 240 fits to
200 and 500 samples with 40 % noise 26 ended at wrong minima without, of 120 longer ones one did."""
ROUNDS = 8
LARGEST = 1e100
"""Of the Steiglitz-McBride iteration, which a start need not finish."""


@dataclass(frozen=True, eq=False)
class _Plant:
    """A, B of each input and F of each, or the one that all share."""

    a: Array
    b: list[Array]
    f: list[Array]

    @property
    def responses(self) -> Iterator[tuple[Array, Array]]:
        """B and F of each input."""
        below = self.f if len(self.f) == len(self.b) else self.f * len(self.b)
        return zip(self.b, below, strict=True)


def polynomial_starts(structure: PolynomialStructure, data: SampledChannels) -> Array:
    """Coefficients to start from, shape (n_starts, n_coefficients), the systematic ones first.

    Reference: Ljung, *System Identification*, 2nd ed., section 10.5 (eqs. 10.66 to 10.73);
    Hannan & Rissanen (1982), Biometrika 69; Steiglitz & McBride (1965), IEEE Trans. AC 10.
    """
    found = [np.array(structure.start)] if structure.start else []
    if len(found) == structure.starts:
        return np.ascontiguousarray(found)
    has_noise = structure.nc + structure.nd > 0
    generator = np.random.default_rng(structure.seed)
    plants = _plants(structure, data)
    # Output error keeps one start for whitened data, should these end at unlike minima.
    wanted = min(structure.starts, SYSTEMATIC) if has_noise else structure.starts - len(found) - 1
    asked = data.output.size <= LONG or structure.starts > SYSTEMATIC + 1
    for _ in range(wanted - len(plants) if any(structure.nf) and asked else 0):
        plants.append(_Plant(np.zeros(structure.na), *drawn_plant(structure, data, generator)))
    found += [_flat(plant, *_noise(structure, data, plant)) for plant in plants]
    if has_noise:
        white = np.zeros(structure.nc), np.zeros(structure.nd)
        found += [_flat(plant, *white) for plant in plants]
    while len(found) < structure.starts and has_noise:
        noise = (_random(generator, structure.nc), _random(generator, structure.nd))
        found.append(_flat(plants[0], *noise))
    starts = np.array(found[: max(structure.starts, 1)])
    return np.ascontiguousarray(np.where(np.isfinite(starts), starts, 0.0))


def _flat(plant: _Plant, c: Array, d: Array) -> Array:
    return np.concatenate([plant.a, *plant.b, c, d, *plant.f])


def _long_model(
    structure: PolynomialStructure, data: SampledChannels
) -> tuple[Array, Array, list[Array]]:
    """Innovations and polynomials of a long ARX model, which mimics every noise model."""
    n_inputs = len(structure.inputs)
    degree = max(structure.na + structure.nd, structure.nc, *structure.nf, *structure.nb, 1)
    shortest = min(data.lengths)
    room = min(sum(data.lengths) // (4 * (n_inputs + 1)), shortest // 3)
    length = max(1, min(20 + 2 * degree, room))
    model = regress(
        data.output,
        data.inputs,
        data.lengths,
        length,
        [length] * n_inputs,
        structure.nk,
        levels=data.levels,
    )
    theta = model.shortest
    a = np.concatenate([[1.0], theta[:length]])
    b = [theta[length * (i + 1) : length * (i + 2)] for i in range(n_inputs)]
    innovations = np.zeros_like(data.output)
    for span in data.spans:
        part = filtered(a, [1.0], data.output[span])
        for row, numerator, delay in zip(data.inputs, b, structure.nk, strict=True):
            part -= filtered(np.concatenate([np.zeros(delay), numerator]), [1.0], row[span])
        part[: length + max([0, *structure.nk])] = 0.0
        innovations[span] = part
    return innovations, a, b


def _plants(structure: PolynomialStructure, data: SampledChannels) -> list[_Plant]:
    innovations, long_a, long_b = _long_model(structure, data)
    if not any(structure.nf):
        return [_with_innovations(structure, data, innovations), _plain(structure, data)]
    every = range(len(structure.inputs))
    sizes = np.std(data.inputs, axis=1)
    b, f = [], []
    for i, n_f in enumerate(structure.degrees_of_f):
        over = list(every) if structure.is_common else [i]
        above, below = _reduced(
            long_a, [long_b[j] for j in over], [structure.nb[j] for j in over], n_f, sizes[over]
        )
        b += above
        f.append(below)
    return [_Plant(np.zeros(structure.na), b, f), _filtered(structure, data)]


def whitened_start(structure: PolynomialStructure, data: SampledChannels) -> Array:
    """One more start of output error, shape (1, n_coefficients), from whitened data.

    Where noise is much stronger at some frequencies, the others tell the plant.
    """
    _, long_a, _ = _long_model(structure, data)
    plant = _filtered(structure, _whitened(data, long_a))
    return np.nan_to_num(_flat(plant, np.zeros(0), np.zeros(0)))[None]


def _whitened(data: SampledChannels, long_a: Array) -> SampledChannels:
    """Channels through what makes a long model's noise white, the start of each record cut off."""
    first = long_a.size - 1
    rows = [
        filtered(long_a, [1.0], np.vstack([data.output, data.inputs])[:, span])
        for span in data.spans
    ]
    kept = np.hstack([row[:, first:] for row in rows])
    lengths = tuple(length - first for length in data.lengths)
    return replace(data, output=kept[0], inputs=np.ascontiguousarray(kept[1:]), lengths=lengths)


def _split(structure: PolynomialStructure, theta: Array) -> tuple[Array, list[Array]]:
    parts = np.split(theta, np.cumsum([structure.na, *structure.nb]))
    return parts[0], list(parts[1 : len(structure.nb) + 1])


def _empty(structure: PolynomialStructure) -> list[Array]:
    return [np.zeros(n) for n in structure.degrees_of_f]


def _with_innovations(
    structure: PolynomialStructure, data: SampledChannels, innovations: Array
) -> _Plant:
    """Second stage: the estimated innovations stand in for the noise as one more input."""
    inputs = np.vstack([data.inputs, innovations])
    nb, nk = [*structure.nb, structure.nc], [*structure.nk, 1]
    theta = regress(
        data.output, inputs, data.lengths, structure.na, nb, nk, levels=data.levels
    ).shortest
    return _Plant(*_split(structure, theta), _empty(structure))


def _plain(structure: PolynomialStructure, data: SampledChannels) -> _Plant:
    theta = regress_structure(structure, data).shortest
    return _Plant(*_split(structure, theta), _empty(structure))


def _reduced(
    long_a: Array, long_b: Sequence[Array], nb: Sequence[int], nf: int, sizes: Array
) -> tuple[list[Array], Array]:
    """B/F, one F, whose pulse responses are those of the long model's channels, delays aside.

    Each response counts by the size of its input, as one record beside the others.
    """
    length, m = 20 * long_a.size, len(long_b)
    pulses = np.zeros((m, m, length))
    pulses[range(m), range(m), 0] = sizes / np.max(sizes)
    with np.errstate(over="ignore", invalid="ignore"):
        responses = np.array([filtered(b, long_a, pulses[i, i]) for i, b in enumerate(long_b)])
    size = np.max(np.abs(responses), axis=1)
    ended = np.abs(responses[:, -1]) <= 0.5 * size
    if min(nb) == 0 or not np.all(np.isfinite(size) & (size > 0.0) & ended):
        plain = [np.pad(b[:n], (0, max(n - len(b), 0))) for b, n in zip(long_b, nb, strict=True)]
        return plain, np.zeros(nf)
    b, f = _steiglitz_mcbride(
        responses.ravel(),
        pulses.transpose(1, 0, 2).reshape(m, -1),
        [length] * m,
        list(nb),
        nf,
        [0] * m,
        levels=False,
    )
    return list(np.split(b, np.cumsum(nb)[:-1])), f


def _filtered(structure: PolynomialStructure, data: SampledChannels) -> _Plant:
    """One denominator for all inputs, from the data themselves."""
    nf = max(structure.nf)
    b, f = _steiglitz_mcbride(
        data.output,
        data.inputs,
        list(data.lengths),
        list(structure.nb),
        nf,
        list(structure.nk),
        levels=data.levels,
    )
    rows = list(np.split(b, np.cumsum(structure.nb)[:-1]))
    return _Plant(np.zeros(structure.na), rows, [f[:n] for n in structure.degrees_of_f])


def _steiglitz_mcbride(
    output: Array,
    inputs: Array,
    lengths: list[int],
    nb: list[int],
    nf: int,
    nk: list[int],
    *,
    levels: bool,
) -> tuple[Array, Array]:
    """Numerators end to end and denominator of an output-error model, by repeated prefilters."""
    f = np.zeros(nf)
    ends = np.cumsum([0, *lengths])
    b = np.zeros(sum(nb))
    for _ in range(ROUNDS):
        below = reflected(np.concatenate([[1.0], f]))
        signals = np.vstack([output, inputs])
        for first, last in pairwise(ends):
            signals[:, first:last] = filtered([1.0], below, signals[:, first:last])
        # Filters at the edge of stability leave no equations: what was found before stands.
        if not np.max(np.abs(signals)) < LARGEST:
            break
        try:
            made = regress(signals[0], signals[1:], lengths, nf, nb, nk, skip=0, levels=levels)
            theta = made.shortest
        except FitError:
            break
        f, b = theta[:nf], theta[nf:]
    return b, f


def _noise(
    structure: PolynomialStructure, data: SampledChannels, plant: _Plant
) -> tuple[Array, Array]:
    """C and D of what the plant leaves, by long autoregression and then least squares."""
    nc, nd = structure.nc, structure.nd
    if nc + nd == 0:
        return np.zeros(0), np.zeros(0)
    left = np.zeros_like(data.output)
    for span in data.spans:
        part = filtered(np.concatenate([[1.0], plant.a]), [1.0], data.output[span])
        for row, (b, f), k in zip(data.inputs, plant.responses, structure.nk, strict=True):
            below = reflected(np.concatenate([[1.0], f]))
            part -= filtered(np.concatenate([np.zeros(k), b]), below, row[span])
        left[span] = part
    none = np.empty((0, left.size))
    length = max(1, min(20 + 2 * (nc + nd), min(data.lengths) // 4))
    long_d = regress(left, none, data.lengths, length, [], [], levels=data.levels).shortest
    innovations = np.concatenate(
        [filtered(np.concatenate([[1.0], long_d]), [1.0], left[span]) for span in data.spans]
    )
    theta = regress(
        left, innovations[None], data.lengths, nd, [nc], [1], levels=data.levels
    ).shortest
    return theta[nd:], theta[:nd]


def _random(generator: np.random.Generator, degree: int) -> Array:
    """Coefficients after the leading one of a polynomial with roots anywhere in the circle."""
    if degree == 0:
        return np.zeros(0)
    radius = np.sqrt(generator.uniform(0.0, 0.95, degree // 2))
    pairs = radius * np.exp(1j * generator.uniform(0.0, np.pi, degree // 2))
    single = generator.uniform(-0.95, 0.95, degree % 2)
    return np.asarray(np.real(np.poly(np.concatenate([pairs, np.conj(pairs), single])))[1:])
