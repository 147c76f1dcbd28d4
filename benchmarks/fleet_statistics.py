"""A fleet's statistics: agreement with peers, coverage, false alarms and power, each counted.

FLIGHTID_FLEET_DRAWS says how many fleets of each size are drawn for coverage (default 400). Each
row is printed as soon as it is there. Fleets are drawn here by NumPy alone: two flights a day for
20 days, errors of 2 to 5 %, a step behind flight 26.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from time import process_time

import numpy as np
from numpy.typing import NDArray
from tests.bcg_trials import log_ratios

from benchmarks.fleet_assumptions import broken_fleets, fleets_alarmed, small_fleets
from benchmarks.fleet_intervals import uneven_fleets
from flightid.fleet.statistics.drift import find_drift
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.local_level import follow_level
from flightid.fleet.statistics.population import estimate_population
from flightid.table import Column, Table

Array = NDArray[np.float64]
Row = tuple[str, str, str, str, float]
VEHICLES, FLIGHTS, CHANGED = 500, 40, 200
DAY_S = 86400.0
COLUMNS = (
    *(Column("question"), Column("found"), Column("needed"), Column("of")),
    Column("processor", "s", 3),
)


def run() -> Table:
    """Every row, printed as it is counted."""
    rows = []
    for part in (_peers, _coverage, _uneven, _drift, _broken):
        rows += list(part())
    return Table("Statistics of a fleet", COLUMNS, tuple(rows))


def _row(begun: float, question: str, found: str, needed: str, of: str) -> Row:
    row = (question, found, needed, of, process_time() - begun)
    print(f"{question}: {found} (needed {needed}; {of}; {row[-1]:.1f} s)", flush=True)
    return row


def _peers() -> Iterator[Row]:
    """The published meta-analysis, and the same numbers by PyMARE and statsmodels."""
    begun = process_time()
    trials, ratio, variance = log_ratios()
    data = FlightEstimates.of(["a"], trials, ratio[:, None], variance[:, None, None])
    found = estimate_population(data)
    one = found.parameters["a"]
    tau2 = float(found.spreads.between[0, 0])
    mean = float(found.spreads.mean[0])
    stderr = float(np.sqrt(found.spreads.mean_covariance[0, 0]))
    told = f"τ² {tau2:.5f}, μ {mean:.5f}, se {stderr:.5f}"
    yield _row(begun, "BCG trials", told, "τ² 0.3132, μ −0.7145, se 0.1798", "13 trials")
    yield _beside(
        "beside PyMARE's REML", "below 1e-4", "τ², μ, its error",
        (tau2, mean, one.mean.stderr or np.nan), lambda: _by_pymare(ratio, variance),
    )  # fmt: skip
    yield _beside(
        "beside statsmodels at that τ²", "below 1e-6", "mean, its error, Knapp and Hartung's",
        (mean, stderr, one.mean.stderr or np.nan), lambda: _by_statsmodels(ratio, variance + tau2),
    )  # fmt: skip
    yield _beside(
        "level beside statsmodels", "below 1e-6", "40 flights, unequal steps and errors",
        (0.0,), lambda: (_levels_apart(),),
    )  # fmt: skip


def _beside(
    question: str, needed: str, of: str, ours: Sequence[float], peer: Callable[[], Sequence[float]]
) -> Row:
    """Largest distance to a peer, where it is installed."""
    begun = process_time()
    try:
        apart = max(abs(a - b) for a, b in zip(ours, peer(), strict=True))
    except ModuleNotFoundError as error:
        return _row(begun, question, f"not counted: {error.name} is not installed", needed, of)
    return _row(begun, question, f"{apart:.1e} apart", needed, of)


def _by_pymare(values: Array, variances: Array) -> tuple[float, float, float]:
    from pymare import Dataset  # noqa: PLC0415 - a peer
    from pymare.estimators import VarianceBasedLikelihoodEstimator  # noqa: PLC0415

    told = VarianceBasedLikelihoodEstimator(method="REML").fit_dataset(Dataset(values, variances))
    summary = told.summary()
    mean, stderr = summary.get_fe_stats()["est"], summary.get_fe_stats()["se"]
    return float(np.ravel(summary.tau2)[0]), float(np.ravel(mean)[0]), float(np.ravel(stderr)[0])


def _by_statsmodels(values: Array, variances: Array) -> tuple[float, float, float]:
    import statsmodels.api as sm  # noqa: PLC0415 - a peer

    model = sm.WLS(values, np.ones(len(values)), weights=1.0 / variances)
    fixed, scaled = model.fit(cov_type="fixed scale"), model.fit()
    return float(fixed.params[0]), float(fixed.bse[0]), float(scaled.bse[0])


def _levels_apart() -> float:
    """Largest distance between two smoothed levels, in their standard errors."""
    from statsmodels.tsa.statespace.kalman_smoother import KalmanSmoother  # noqa: PLC0415

    rng, n, rate = np.random.default_rng(5), FLIGHTS, 0.4
    time_s = np.cumsum(rng.uniform(0.1, 2.0, n))
    variances = rng.uniform(0.2, 1.0, n)
    values = np.cumsum(rng.normal(size=n))
    theirs = KalmanSmoother(k_endog=1, k_states=1)
    theirs.bind(values[:, None])
    for name in ("design", "transition", "selection"):
        theirs[name] = np.ones((1, 1))
    theirs["obs_cov"] = variances.reshape(1, 1, n)
    theirs["state_cov"] = (rate * np.append(np.diff(time_s), 1.0)).reshape(1, 1, n)
    theirs.initialize_diffuse()
    smoothed = theirs.smooth()
    found = follow_level(values, variances, time_s, rate)
    apart = np.abs(found.level - smoothed.smoothed_state[0]) / np.sqrt(found.variance)
    wider = np.abs(found.variance / smoothed.smoothed_state_cov[0, 0] - 1.0)
    return float(max(apart.max(), wider.max()))


def _coverage() -> Iterator[Row]:
    """Mean, spread and next vehicle of fleets of 5, 10 and 20, spread 0.5 to 3 errors."""
    draws = int(os.environ.get("FLIGHTID_FLEET_DRAWS", "400"))
    for k in (5, 10, 20):
        begun, every = process_time(), []
        for spread in (0.5, 1.0, 3.0):
            rng = np.random.default_rng(1000 * k + int(10 * spread))
            held = np.mean([_held(rng, k, spread) for _ in range(draws)], axis=0)
            every.append(held)
            told = ", ".join(f"{each:.1%}" for each in held)
            print(f"  {k} vehicles, spread {spread:g}: mean, spread, next in {told}", flush=True)
        mean, spread, following = np.mean(every, axis=0)
        error = np.sqrt(0.95 * 0.05 / (3 * draws))
        told = f"next {following:.1%}, mean {mean:.1%}, spread {spread:.1%}"
        of = f"{3 * draws} fleets, ±{error:.1%}"
        yield _row(begun, f"intervals of {k} vehicles", told, "93 to 97 %", of)


def _held(rng: np.random.Generator, k: int, spread: float) -> list[float]:
    """Whether mean and spread lie in their intervals, and how probably the next vehicle does."""
    variances = rng.uniform(0.3, 2.0, k)
    values = 10.0 + spread * rng.normal(size=k) + np.sqrt(variances) * rng.normal(size=k)
    names = [f"{i:02}" for i in range(k)]
    data = FlightEstimates.of(["a"], names, values[:, None], variances[:, None, None])
    one = estimate_population(data).parameters["a"]
    held: list[float] = []
    for each, truth in ((one.mean, 10.0), (one.spread, spread)):
        low, high = each.interval95 or (np.inf, -np.inf)
        held.append(float(low <= truth <= high))
    low, high = one.next_vehicle.interval95 or (10.0, 10.0)
    following = NormalDist(10.0, spread)
    return [*held, following.cdf(high) - following.cdf(low)]


def _uneven() -> Iterator[Row]:
    """The same where errors go with the estimate, differ, or few flights tell."""
    for words, count, of in uneven_fleets():
        begun = process_time()
        yield _row(begun, words, count(), "93 to 97 %", of)


@dataclass(frozen=True)
class Drawn:
    """A fleet, with what its flights tell beside."""

    data: FlightEstimates
    covariates: dict[str, list[float | str | None]]


def _drawn(
    seed: int, *, change: float = 0.0, understated: float = 1.0, explained: bool = False
) -> Drawn:
    rng = np.random.default_rng(seed)
    n = VEHICLES * FLIGHTS
    day = np.repeat(np.arange(FLIGHTS // 2), 2)
    time_s = np.tile(DAY_S * day + np.tile([0.0, 3600.0], FLIGHTS // 2), VEHICLES)
    errors = rng.uniform(0.02, 0.05, n)
    values = np.repeat(1.0 + 0.1 * rng.normal(size=VEHICLES), FLIGHTS)
    hit = np.repeat(np.arange(VEHICLES) < CHANGED, FLIGHTS)
    values[hit & np.tile(np.arange(FLIGHTS) > 25, VEHICLES)] *= 1.0 + change
    values += understated * errors * rng.normal(size=n)
    covariates: dict[str, list[float | str | None]] = {}
    if explained:
        battery = rng.uniform(14.0, 17.0, n)
        firmware = np.where(time_s > 10 * DAY_S, "4.6", "4.5")
        values += 0.02 * (battery - 15.5) + 0.08 * (firmware == "4.6")
        covariates = {"battery": battery.tolist(), "firmware": firmware.tolist()}
    names = np.repeat([f"{i:03}" for i in range(VEHICLES)], FLIGHTS).tolist()
    data = FlightEstimates.of(
        ["gain"], names, values[:, None], (errors**2)[:, None, None], time_s=time_s
    )
    return Drawn(data, covariates)


def _drift() -> Iterator[Row]:
    """False alarms without change, and what is found of changes."""
    for words, options in (
        ("errors as told", {}),
        ("errors understated by two", {"understated": 2.0}),
        ("battery and firmware at work", {"explained": True}),
        ("both", {"understated": 2.0, "explained": True}),
    ):
        begun, drawn = process_time(), _drawn(41, **options)
        found = find_drift(drawn.data, drawn.covariates)
        alarmed = len({each.vehicle for each in found.alarms})
        told = f"{alarmed} of {VEHICLES} alarmed ({alarmed / VEHICLES:.1%})"
        yield _row(begun, f"no change, {words}", told, "at most 5 %", f"{VEHICLES} vehicles")
    for change in (0.05, 0.1, 0.2):
        begun, drawn = process_time(), _drawn(42, change=change)
        alarms = find_drift(drawn.data, drawn.covariates).alarms
        mine = [each for each in alarms if int(each.vehicle) < CHANGED]
        sizes = [each.change_percent.interval95 or (np.inf, -np.inf) for each in mine]
        held = np.mean([low <= 100.0 * change <= high for low, high in sizes])
        false = len({each.vehicle for each in alarms}) - len(mine)
        told = f"{len(mine) / CHANGED:.1%} found, size held in {held:.1%}, {false} false"
        of = f"{CHANGED} of {VEHICLES} vehicles"
        yield _row(begun, f"steps by {change:.0%}", told, "found, with its size", of)


def _broken() -> Iterator[Row]:
    """Fleets that break what is assumed."""
    for words, fleet in broken_fleets():
        begun = process_time()
        yield _row(begun, words, fleet.told(43), "few without change", f"{fleet.vehicles} vehicles")
    for words, fleet in small_fleets():
        begun = process_time()
        yield _row(begun, words, fleets_alarmed(fleet), "at most 5 %, or all", "100 fleets")
