"""Restricted likelihood of flights within vehicles within a type, with its exact gradient.

An estimate y_ij of flight j of vehicle i is μ + b_i + w_ij + e_ij: the type, what makes the
vehicle (covariance T), what makes the flight (covariance F) and the error of the fit (covariance
S_ij, known in full). With W_ij = (S_ij + F)⁻¹, A_i = Σ_j W_ij and z_i = Σ_j W_ij y_ij a vehicle
needs matrices of p × p alone, and no inverse of T or A_i: T may be singular and parameters missing.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.frozen import dataclass

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The likelihood at one pair of spreads.

    Attributes
    ----------
    cost : float
        −2 log restricted likelihood, without its constant.
    mean : ndarray, shape (p,)
        Of the type, by generalised least squares.
    mean_information : ndarray, shape (p, p)
        Inverse of the mean's covariance.
    between_slope, within_slope : ndarray, shape (p, p)
        Derivatives of the cost along T and F.
    information : ndarray, shape (k, p, p)
        A_i: what the flights of each vehicle know of it.
    score : ndarray, shape (k, p)
        z_i: with A_i it gives the vehicle's own estimate A_i⁻¹ z_i.
    """

    cost: float
    mean: Array
    mean_information: Array
    between_slope: Array
    within_slope: Array
    information: Array
    score: Array


@dataclass(frozen=True, eq=False)
class RestrictedLikelihood:
    """Flights sorted by vehicle, ready to be evaluated.

    Attributes
    ----------
    values : ndarray, shape (n, p)
    covariances : ndarray, shape (n, p, p)
        1 on the diagonal of what is not known.
    known : ndarray of bool, shape (n, p)
    starts : ndarray of int, shape (k,)
        First flight of each vehicle.

    References
    ----------
    Harville, *J. Am. Stat. Assoc.* 72 (1977), 320–338 (restricted likelihood); Jackson, Riley &
    White, *Statistics in Medicine* 30 (2011), 2481–2498 (several outcomes with known covariances).
    """

    values: Array
    covariances: Array
    known: Flags
    starts: NDArray[np.intp]
    _pairs: Flags = field(init=False)
    _alone: tuple[Array, float] = field(init=False)

    def __post_init__(self) -> None:
        pairs = self.known[:, :, None] & self.known[:, None, :]
        object.__setattr__(self, "_pairs", pairs)
        object.__setattr__(self, "_alone", self._weights(np.zeros((self.p, self.p))))

    @classmethod
    def of(cls, data: FlightEstimates) -> RestrictedLikelihood:
        """Of estimates as they are: their caller has scaled them."""
        order = np.argsort(data.member_of, kind="stable")
        member = data.member_of[order]
        known = data.known[order]
        starts = np.flatnonzero(np.diff(member, prepend=-1))
        covariances = data.covariances[order] + np.eye(len(data.names)) * ~known[:, None, :]
        return cls(data.values[order], covariances, known, starts)

    @property
    def p(self) -> int:
        """Parameters."""
        return int(self.values.shape[1])

    def _weights(self, within: Array) -> tuple[Array, float]:
        """W_ij, zero where nothing is known, and Σ log|S_ij + F|."""
        total = self.covariances + np.where(self._pairs, within, 0.0)
        weights = np.where(self._pairs, np.linalg.inv(total), 0.0)
        return weights, float(np.linalg.slogdet(total)[1].sum())

    def evaluate(self, between: Array, within: Array | None) -> Evaluation:
        """Cost and slopes at spreads between vehicles and between flights of one (None: none)."""
        weights, log_size = self._alone if within is None else self._weights(within)
        weighted = np.einsum("nij,nj->ni", weights, self.values)
        information = np.add.reduceat(weights, self.starts)
        score = np.add.reduceat(weighted, self.starts)
        growth = np.eye(self.p) + between @ information
        shrink: Array = np.linalg.inv(growth).astype(np.float64)  # (I + T A)⁻¹
        precision = information @ shrink  # of a vehicle about the type
        mean_information = precision.sum(axis=0)
        pulled = np.einsum("kji,kj->i", shrink, score)
        mean = np.asarray(np.linalg.solve(mean_information, pulled), dtype=np.float64)
        apart = score - information @ mean
        pull = np.einsum("kji,kj->ki", shrink, apart)
        cost = (
            log_size
            + float(np.linalg.slogdet(growth)[1].sum())
            + float(np.sum(self.values * weighted) - mean @ (score.sum(axis=0) + apart.sum(axis=0)))
            - float(np.sum((apart @ between) * pull))
            + float(np.linalg.slogdet(mean_information)[1])
        )
        spread = np.linalg.inv(mean_information)
        between_slope = mean_information - pull.T @ pull
        between_slope = between_slope - _summed(precision @ spread, precision)
        within_slope = np.zeros((self.p, self.p))
        if within is not None:
            within_slope = self._within_slope(weights, between, shrink, pull, mean, spread)
        return Evaluation(
            cost, mean, mean_information, between_slope, within_slope, information, score
        )

    def _within_slope(
        self, weights: Array, between: Array, shrink: Array, pull: Array, mean: Array, spread: Array
    ) -> Array:
        """Derivative of the cost along F."""
        counts = np.diff(self.starts, append=len(self.values))
        repeat = np.repeat(np.arange(len(self.starts)), counts)
        shared = (shrink @ between)[repeat]  # (I + T A)⁻¹ T
        left = self.values - mean - (pull @ between)[repeat]
        residual = np.einsum("nij,nj->ni", weights, left)
        design = weights @ shrink[repeat]
        slope = weights.sum(axis=0) - residual.T @ residual
        slope = slope - _summed(weights @ shared, weights)
        return np.asarray(slope - _summed(design @ spread, design.transpose(0, 2, 1)))


def _summed(left: Array, right: Array) -> Array:
    """Σₖ Lₖ Rₖ as one product: a search asks for it thousands of times, each of few numbers."""
    p = left.shape[1]
    return np.asarray(left.transpose(1, 0, 2).reshape(p, -1) @ right.reshape(-1, right.shape[2]))
