"""Candidate terms of a NARX model and their columns (native side: `candidates.rs`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations_with_replacement, product
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import FitError, OptionError
from flightid.frozen import dataclass
from flightid.models.narx.structure import NarxStructure
from flightid.models.narx.terms import Term, product_term

Array = NDArray[np.float64]
MAXIMUM_CANDIDATES = 50_000
MOST_PRODUCTS, FEWEST_CENTRES = 20_000_000, 100
"""Samples times centres from which on clusters stand for the samples, and fewest of those."""
CLUSTERED = 20_000
"""Most samples that the clusters are made of, evenly over the records."""
ITERATIONS, SPREAD_OUT = 10, 200


@dataclass(frozen=True)
class CandidateTerms:
    """Products, the first `forced` always kept, then radial functions of their centres."""

    products: tuple[Term, ...]
    radial: tuple[Term, ...]
    forced: int

    @property
    def terms(self) -> tuple[Term, ...]:
        """All, in the order of the native half."""
        return self.products + self.radial

    def centres(self, dimension: int) -> Array:
        """Centres, (n_radial, dimension)."""
        return np.array([term.centre for term in self.radial]).reshape(-1, dimension)


def candidate_terms(model: NarxStructure, vectors: Array) -> CandidateTerms:
    """What a model may choose from; centres come from the regressor vectors."""
    products, forced = _products(model)
    rows = _centres(model, vectors).tolist()
    radial = [Term(f"{model.kernel} {i}", centre=tuple(row)) for i, row in enumerate(rows, start=1)]
    if not products and not radial:
        raise FitError(
            "the model has no candidate terms",
            needed="constant, linear, degree above 1 or a kernel",
        )
    return CandidateTerms(tuple(products), tuple(radial), forced)


def product_columns(terms: Sequence[Term], model: NarxStructure, vectors: Array) -> Array:
    """Values of products, (n_terms, n_samples)."""
    places = {lag: place for place, lag in enumerate(model.lags)}
    columns = np.ones((len(terms), len(vectors)))
    for row, term in enumerate(terms):
        for lag, power in term.factors:
            columns[row] *= vectors[:, places[lag]] ** power
    return columns


def _products(model: NarxStructure) -> tuple[list[Term], int]:
    """Terms of products, the forced ones first, and how many are forced."""
    lags = model.lags
    forced = [product_term([])] if model.constant else []
    forced += [product_term([lag]) for lag in lags] if model.linear else []
    count = sum(math.comb(len(lags) + d - 1, d) for d in range(2, model.degree + 1))
    _require_few(count, "products of lags", "lower degree or use fewer lags")
    free = [
        product_term(combination)
        for degree in range(2, model.degree + 1)
        for combination in combinations_with_replacement(lags, degree)
    ]
    return forced + free, len(forced)


def _require_few(count: int, what: str, action: str) -> None:
    if count > MAXIMUM_CANDIDATES:
        raise OptionError(
            f"too many {what}", found=count, needed=f"at most {MAXIMUM_CANDIDATES}", action=action
        )


def _centres(model: NarxStructure, regressors: Array) -> Array:
    dimension = regressors.shape[1]
    if model.kernel is None:
        return np.empty((0, dimension))
    if model.candidates == "kmeans":
        return _clusters(regressors, model.n_candidates, model.seed)
    if model.candidates == "grid":
        _require_few(
            model.n_candidates**dimension, "grid centres", "use data points, or fewer levels"
        )
        low, high = regressors.min(axis=0), regressors.max(axis=0)
        levels = [np.linspace(a, b, model.n_candidates) for a, b in zip(low, high, strict=True)]
        return np.array(list(product(*levels)), dtype=np.float64)
    return _clusters(regressors, most_centres(len(regressors)), model.seed)


def most_centres(n_samples: int) -> int:
    """Centres up to which the choice of terms takes time in proportion to the samples.

    Example
    -------
    >>> most_centres(4000), most_centres(10_000), most_centres(1_000_000)
    (5000, 2000, 100)
    """
    return max(MOST_PRODUCTS // n_samples, FEWEST_CENTRES)


def _clusters(regressors: Array, count: int, seed: int) -> Array:
    """The regressors themselves where they are no more, else centres of their clusters."""
    if count >= len(regressors):
        return regressors
    some = regressors[:: -(-len(regressors) // max(CLUSTERED, 10 * count))]
    generator = np.random.default_rng(seed)
    # Spread-out first centres take a time with the square of their number.
    first: Literal["++", "points"] = "++" if count <= SPREAD_OUT else "points"
    centres, label = scipy.cluster.vq.kmeans2(
        some, count, iter=ITERATIONS, minit=first, rng=generator
    )
    return np.ascontiguousarray(centres[np.unique(label)])
