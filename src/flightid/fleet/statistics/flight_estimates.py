"""Estimates of many flights with their covariances: what every question of a fleet begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, ShapeError, UnknownNameError
from flightid.frozen import dataclass

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, repr=False)
class FlightEstimates:
    """Estimates of the same parameters by flight, each with its full covariance.

    Attributes
    ----------
    names : tuple of str, length p
        Parameters.
    units : tuple of str, length p
    vehicles : tuple of str, length n
        Which vehicle each flight was of.
    time_s : ndarray, shape (n,)
        When each flight began, s from any one instant.
    values : ndarray, shape (n, p)
        Estimates; 0 where `known` is False.
    covariances : ndarray, shape (n, p, p)
        Of each flight's estimates; 0 in rows and columns that are not known.
    known : ndarray of bool, shape (n, p)
        Which parameters a flight told with an interval.
    flights : tuple of str, length n
        What each flight is called: hash or address of its log.

    Raises
    ------
    ShapeError
        Shapes that do not agree.
    DataError
        A number that is not finite, a variance that is not positive, a matrix that is no
        covariance.

    Example
    -------
    >>> made = FlightEstimates.of(["Lp"], ["a", "a", "b"], [[-5.0], [-5.2], [-4.1]],
    ...                           np.full((3, 1, 1), 0.01))
    >>> made
    FlightEstimates(3 flights of 2 vehicles, 1 parameter)
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    vehicles: tuple[str, ...]
    time_s: Array
    values: Array
    covariances: Array
    known: Flags
    flights: tuple[str, ...]

    def __post_init__(self) -> None:
        n, p = len(self.vehicles), len(self.names)
        shapes = {
            "units": ((len(self.units),), (p,)),
            "flights": ((len(self.flights),), (n,)),
            "time_s": (self.time_s.shape, (n,)),
            "values": (self.values.shape, (n, p)),
            "known": (self.known.shape, (n, p)),
            "covariances": (self.covariances.shape, (n, p, p)),
        }
        for name, (found, needed) in shapes.items():
            if found != needed:
                raise ShapeError(f"{name} of {n} flights and {p} parameters", found=found,
                                 needed=needed)  # fmt: skip
        self._require_numbers()

    def _require_numbers(self) -> None:
        for name in ("time_s", "values", "covariances"):
            if not np.all(np.isfinite(getattr(self, name))):
                raise DataError(
                    f"{name} of a fleet's flights are not all finite",
                    needed="numbers, and none marked as known where there is none",
                )
        variances = np.einsum("npp->np", self.covariances)
        if not np.all(variances[self.known] > 0.0):
            n, p = np.argwhere(self.known & ~(variances > 0.0))[0]
            raise DataError(
                "an estimate of a fleet has no positive variance",
                found=f"{self.names[p]} of flight {self.flights[n]}: {variances[n, p]:g}",
                needed="a positive one, or an estimate that is marked as not known",
            )
        if len(self.vehicles) and np.any(self.known):
            scale = np.sqrt(np.where(self.known, variances, 1.0))
            alike = self.covariances / (scale[:, :, None] * scale[:, None, :])
            symmetric = np.allclose(alike, np.swapaxes(alike, 1, 2), atol=1e-8)
            if not symmetric or np.linalg.eigvalsh(alike).min() < -1e-8:
                raise DataError(
                    "a matrix of a fleet's flight is no covariance",
                    needed="symmetric, no eigenvalue below 0",
                )

    @classmethod
    def of(
        cls,
        names: Sequence[str],
        vehicles: Sequence[str],
        values: ArrayLike,
        covariances: ArrayLike,
        *,
        time_s: ArrayLike | None = None,
        units: Sequence[str] | None = None,
        known: ArrayLike | None = None,
        flights: Sequence[str] | None = None,
    ) -> FlightEstimates:
        """Estimates from plain arrays; what is not known counts as absent.

        Parameters
        ----------
        names : sequence of str, length p
        vehicles : sequence of str, length n
        values : array_like, shape (n, p)
        covariances : array_like, shape (n, p, p)
        time_s : array_like, shape (n,), optional
            Default: 0, 1, 2 ….
        units : sequence of str, length p, optional
            Default: ``"1"``.
        known : array_like of bool, shape (n, p), optional
            Default: all.
        flights : sequence of str, length n, optional
            Default: their number.
        """
        n, p = len(vehicles), len(names)
        there = np.ones((n, p), dtype=bool) if known is None else np.asarray(known, dtype=bool)
        numbers = np.asarray(values, dtype=np.float64)
        matrices = np.asarray(covariances, dtype=np.float64)
        if there.shape == numbers.shape == (n, p) and matrices.shape == (n, p, p):
            numbers = np.where(there, numbers, 0.0)
            matrices = np.where(there[:, :, None] & there[:, None, :], matrices, 0.0)
        time = np.arange(float(n)) if time_s is None else np.asarray(time_s, dtype=np.float64)
        return cls(
            tuple(names),
            ("1",) * p if units is None else tuple(units),
            tuple(vehicles),
            time,
            numbers,
            matrices,
            there,
            tuple(map(str, range(n))) if flights is None else tuple(flights),
        )

    def __repr__(self) -> str:
        """Numbers of flights, vehicles and parameters."""
        n, k, p = len(self.vehicles), len(self.members), len(self.names)
        return f"FlightEstimates({n} flights of {k} vehicles, {p} parameter{'s' * (p != 1)})"

    @cached_property
    def members(self) -> tuple[str, ...]:
        """Vehicles, each once, sorted."""
        return tuple(sorted(set(self.vehicles)))

    @cached_property
    def member_of(self) -> NDArray[np.intp]:
        """Place in `members` of each flight's vehicle, shape (n,)."""
        places = {name: place for place, name in enumerate(self.members)}
        return np.array([places[name] for name in self.vehicles], dtype=np.intp)

    def place(self, name: str) -> int:
        """Column of a parameter.

        Raises
        ------
        UnknownNameError
            There is none of the name.
        """
        if name not in self.names:
            raise UnknownNameError(
                "no such parameter in the fleet", found=name, needed=", ".join(self.names)
            )
        return self.names.index(name)

    def chosen(self, flights: Flags | NDArray[np.intp]) -> FlightEstimates:
        """The same of some flights, in their order."""
        places = np.arange(len(self.vehicles))[flights]
        return replace(
            self,
            vehicles=tuple(self.vehicles[i] for i in places),
            flights=tuple(self.flights[i] for i in places),
            time_s=self.time_s[places],
            values=self.values[places],
            covariances=self.covariances[places],
            known=self.known[places],
        )

    def of_parameters(self, chosen: Flags) -> FlightEstimates:
        """The same of some parameters, without flights that tell none of them."""
        places = np.flatnonzero(chosen)
        fewer = replace(
            self,
            names=tuple(self.names[i] for i in places),
            units=tuple(self.units[i] for i in places),
            values=self.values[:, places],
            covariances=self.covariances[:, places[:, None], places],
            known=self.known[:, places],
        )
        return fewer.chosen(np.flatnonzero(fewer.known.any(axis=1)))

    def of_vehicle(self, vehicle: str) -> FlightEstimates:
        """Flights of one vehicle by time.

        Raises
        ------
        UnknownNameError
            There is none of the name.
        """
        if vehicle not in self.members:
            raise UnknownNameError(
                "no such vehicle in the fleet", found=vehicle, needed=", ".join(self.members[:20])
            )
        places = np.flatnonzero(self.member_of == self.members.index(vehicle))
        return self.chosen(places[np.argsort(self.time_s[places], kind="stable")])
