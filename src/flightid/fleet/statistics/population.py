"""The type: mean, spread between vehicles, and where the next vehicle lies, by parameter."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.errors_by_value import errors_at_the_type
from flightid.fleet.statistics.flight_estimates import Flags, FlightEstimates
from flightid.fleet.statistics.heterogeneity import FEWEST, VehicleEstimates
from flightid.fleet.statistics.spread_search import SpreadFit, search_spreads
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.threads import on_one_thread
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.quantiles import LEVEL, half_width, interval_words, shown

Array = NDArray[np.float64]
ALIKE = "vehicles that are all equal say nothing of the next"
UNTOLD = "too few vehicles have several flights that tell it"
NO_NEXT = f"fewer than {FEWEST} vehicles say nothing of the next"


@dataclass(frozen=True)
class NextVehicleEnds:
    """Ends of the interval that holds the next vehicle."""

    vehicles: VehicleEstimates

    def __call__(self, level: float) -> tuple[float, float] | None:
        """Lower and upper end at a level."""
        return self.vehicles.next_ends(level)


@dataclass(frozen=True)
class MeanEnds:
    """Ends of the interval of a mean: as the vehicles' own, about one that flights share in."""

    vehicles: VehicleEstimates
    mean: float
    own_mean: float
    scale: float

    def __call__(self, level: float) -> tuple[float, float]:
        """Lower and upper end at a level."""
        low, high = self.vehicles.mean_ends(level)
        return (
            self.mean + self.scale * (low - self.own_mean),
            self.mean + self.scale * (high - self.own_mean),
        )


@dataclass(frozen=True)
class SpreadEnds:
    """Ends of the interval of a standard deviation between vehicles."""

    vehicles: VehicleEstimates

    def __call__(self, level: float) -> tuple[float, float]:
        """Lower and upper end at a level."""
        return self.vehicles.spread_ends(level)


@dataclass(frozen=True)
class TypeParameter:
    """One parameter of a type.

    Attributes
    ----------
    mean : Estimate
        Of the type; standard error by Hartung and Knapp, with one degree of freedom less than
        vehicles; its interval over the spreads that they allow.
    spread : Estimate
        Standard deviation between vehicles.
    next_vehicle : Estimate
        The mean with the interval that holds the parameter of the next vehicle.
    flight_spread : Estimate
        Standard deviation between flights of one vehicle beyond the errors of the fits; None where
        too few flights tell it: what there is of it then counts as spread between vehicles.
    inconsistency_percent : float
        I²: share of the scatter of vehicles that is no error of estimates.
    chance_alike : float
        Chance of differences as large were all vehicles the same.
    n_vehicles : int
    """

    mean: Estimate
    spread: Estimate
    next_vehicle: Estimate
    flight_spread: Reading
    inconsistency_percent: float
    chance_alike: float
    n_vehicles: int


@dataclass(frozen=True, eq=False, repr=False)
class Population(
    Result,
    schema="flightid.population/1",
    untold={"data": "the catalogue keeps the estimates of every flight"},
):
    """What the vehicles of a type have in common, and how far they differ.

    Attributes
    ----------
    type_name : str
    parameters : mapping of str to TypeParameter
    spreads : SpreadFit
        Mean and covariances of all parameters together.
    data : FlightEstimates
        Errors as they count: `errors_at_the_type`.

    Example
    -------
    >>> rng = np.random.default_rng(1)
    >>> truth = -5.0 + 0.5 * rng.normal(size=12)
    >>> values = np.repeat(truth, 4) + 0.1 * rng.normal(size=48)
    >>> data = FlightEstimates.of(["Lp"], np.repeat([*"abcdefghijkl"], 4), values[:, None],
    ...                           np.full((48, 1, 1), 0.01), units=["1/s"])
    >>> estimate_population(data, "quad")
    Population('quad', 12 vehicles, 48 flights, 1 parameter, I² 98 % at most)
    """

    type_name: str
    parameters: dict[str, TypeParameter]
    spreads: SpreadFit
    data: FlightEstimates

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters, in the order of the covariances."""
        return self.data.names

    @cached_property
    def own(self) -> tuple[tuple[Array, Array, Flags], ...]:
        """Each vehicle's own estimate, its covariance, and which parameters its flights told."""
        return _own(self.spreads)

    @property
    def next_covariance(self) -> Array:
        """Covariance of the next vehicle about the mean, for what takes it as normal; shape (p, p).

        Spread and error of the mean, each parameter widened so that its normal 95 % interval is as
        long as the one that `TypeParameter.next_vehicle` prints: few vehicles tell a spread badly.
        """
        plain = self.spreads.between + self.spreads.mean_covariance
        widened = np.ones(len(self.names))
        for i, name in enumerate(self.names):
            half = self.parameters[name].next_vehicle.half()
            if half is not None:
                widened[i] = max(half / (half_width(LEVEL) * np.sqrt(plain[i, i])), 1.0)
        return np.asarray(plain * np.outer(widened, widened))

    def __repr__(self) -> str:
        """Size and the largest share that is between vehicles."""
        p, most = len(self.names), max(x.inconsistency_percent for x in self.parameters.values())
        return (
            f"Population({self.type_name!r}, {len(self.data.members)} vehicles, "
            f"{len(self.data.vehicles)} flights, {p} parameter{'s' * (p != 1)}, "
            f"I² {most:.0f} % at most)"
        )

    def summary(
        self, *, level: float | None = None, labels: Mapping[str, str] | None = None
    ) -> Table:
        """One row a parameter, in words where there are any: mean, and where the next one lies."""
        level = shown(level)
        words = interval_words(level)
        columns = (
            *(Column("parameter"), Column("symbol"), Column("unit")),
            *(Column("mean"), Column("low"), Column("high")),
            *(Column("next vehicle low"), Column("next vehicle high"), Column("vehicles")),
        )
        rows: list[tuple[Cell, ...]] = []
        for name, found in self.parameters.items():
            ends = (
                each.interval(level) or (None, None) for each in (found.mean, found.next_vehicle)
            )
            mean, following = ends
            told = (*self._named(name, labels), found.mean.value, *mean, *following)
            rows.append((*told, found.n_vehicles))
        note = f"Low and high are the {words} interval of the mean"
        if any(each.next_vehicle.interval(level) for each in self.parameters.values()):
            note += f"; the next vehicle lies between its two columns with {words}."
        else:
            note += f"; {next(iter(self.parameters.values())).next_vehicle.reason or ALIKE}."
        title = f"In common: type “{self.type_name}”"
        return Table(title, columns, tuple(rows), (note,)).without_empty_columns()

    def spread_table(
        self, *, level: float | None = None, labels: Mapping[str, str] | None = None
    ) -> Table:
        """One row a parameter: how far vehicles differ, and flights of one.

        Parameters
        ----------
        level : float, optional
            Of the intervals; default: as shown elsewhere.
        labels : mapping of str to str, optional
            Parameters in words.
        """
        level = shown(level)
        columns = (
            *(Column("parameter"), Column("unit"), Column("between vehicles", digits=3)),
            *(Column("low", digits=3), Column("high", digits=3)),
            *(Column("between flights", digits=3), Column("I²", "%", digits=3)),
        )
        rows: list[tuple[Cell, ...]] = []
        for name, found in self.parameters.items():
            words, _, unit = self._named(name, labels)
            spread = found.spread.interval(level) or (None, None)
            told = (words, unit, found.spread.value, *spread, found.flight_spread.value)
            rows.append((*told, found.inconsistency_percent))
        note = (
            f"Standard deviations by restricted likelihood, between vehicles "
            f"{self.spreads.structure}, between flights {self.spreads.within_structure}; low and "
            f"high are the {interval_words(level)} interval. It takes vehicles for draws of a "
            "normal distribution, longer where some lie further out: with few odd ones among many "
            "it holds the truth less often. I² is the share of what is seen that is no error."
        )
        title = f"How far apart: type “{self.type_name}”"
        return Table(title, columns, tuple(rows), (note,)).without_empty_columns()

    def _named(self, name: str, labels: Mapping[str, str] | None) -> tuple[str, str | None, str]:
        """A parameter in words, its symbol where these are others, and its unit."""
        named, unit = labels or {}, self.parameters[name].mean.unit
        return named.get(name, name), name if name in named else None, "" if unit == "1" else unit


@on_one_thread
def estimate_population(
    data: FlightEstimates,
    type_name: str = "",
    *,
    structure: str | None = None,
    within_structure: str | None = None,
    errors_at_type: bool = True,
) -> Population:
    """Estimate what the vehicles of a type have in common.

    Parameters
    ----------
    data : FlightEstimates
        Flights of one type.
    type_name : str
        For words.
    structure, within_structure : str, optional
        Of the spread between vehicles, and between flights of one: ``"diagonal"``, ``"factor"``,
        ``"full"``; default: what the numbers of vehicles and flights support.
    errors_at_type : bool
        Whether errors that go with the estimates are taken at the type's value; False of estimates
        whose errors were worked out there.

    Returns
    -------
    Population

    Raises
    ------
    DataError
        A parameter that fewer than two vehicles tell.
    FitError
        No search ended in finite numbers.

    Assumes
    -------
    Vehicles are independent draws of one normal population, errors are normal with the covariance
    that is given; where they go with the estimate they are taken at the type's value
    (`errors_at_the_type`). Biased where errors are understated and no vehicle flew twice: they then
    count as spread between vehicles.

    Reference
    ---------
    Jackson, Riley & White, *Statistics in Medicine* 30 (2011), 2481–2498; intervals as in
    `flightid.fleet.statistics.heterogeneity.VehicleEstimates`.
    """
    data = errors_at_the_type(data) if errors_at_type else data
    spreads = search_spreads(data, structure=structure, within_structure=within_structure)
    own = _own(spreads)
    parameters = {}
    for i, name in enumerate(data.names):
        there = [each for each in own if each[2][i]]
        vehicles = VehicleEstimates(
            np.array([value[i] for value, _, _ in there]),
            np.array([covariance[i, i] for _, covariance, _ in there]),
        )
        parameters[name] = _parameter(name, data.units[i], i, spreads, vehicles)
    return Population(type_name, parameters, spreads, data)


def _own(spreads: SpreadFit) -> tuple[tuple[Array, Array, Flags], ...]:
    return tuple(spreads.vehicle(place) for place in range(len(spreads.score)))


def _parameter(
    name: str, unit: str, i: int, spreads: SpreadFit, vehicles: VehicleEstimates
) -> TypeParameter:
    variance = float(spreads.between[i, i])
    mean = float(spreads.mean[i])
    scatter = vehicles.hartung_knapp(variance)
    own_mean, total, _ = vehicles.weighed(np.array([variance]))
    # Beside what a vehicle's flights tell of a parameter alone, the others' tell by correlation.
    gain = float(np.sqrt(spreads.mean_covariance[i, i] * total[0]))
    stderr = float(np.sqrt(spreads.mean_covariance[i, i] * scatter))
    ends = MeanEnds(vehicles, mean, float(own_mean[0]), gain)
    few = len(vehicles.values) < FEWEST
    within = spreads.within
    flights: Reading = Estimate(name, None, unit, None, UNTOLD)
    if within is not None and spreads.within_told[i]:
        flights = Estimate(name, float(np.sqrt(within[i, i])), unit, None, "a spread of its own")
    return TypeParameter(
        Estimate(name, mean, unit, stderr, freedom=float(vehicles.freedom), ends=ends),
        Estimate(name, float(np.sqrt(variance)), unit, ends=SpreadEnds(vehicles)),
        Estimate(
            name,
            mean,
            unit,
            reason=NO_NEXT if few else "",
            ends=None if few else NextVehicleEnds(vehicles),
        ),
        flights,
        100.0 * vehicles.inconsistency(variance),
        vehicles.chance_alike,
        len(vehicles.values),
    )
