"""The study's tables: what was published, what was left out, and what the data say about it."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from identification import Identified, Refusal
from vehicles import COUPLINGS, RATES

import flightid as fid
from flightid.table import Cell, Column, Table

PUBLISHED = tomllib.loads(Path(__file__).with_name("published.toml").read_text(encoding="utf-8"))
Attempt = fid.Fit | Refusal


def _half(parameter: fid.Estimate) -> float | None:
    found = parameter.interval95
    return None if found is None else (found[1] - found[0]) / 2.0


def _covers(parameter: fid.Estimate, value: float) -> bool | None:
    found = parameter.interval95
    return None if found is None else found[0] <= value <= found[1]


def parameters(found: Identified, truth: Mapping[str, float]) -> Table:
    """Table 3 with what it leaves out."""
    rows: list[tuple[Cell, ...]] = []
    for fit in found.time.values():
        for name, p in fit.parameters.items():
            low, high = p.interval95 or (None, None)
            rows.append(
                (
                    *(name, p.unit, truth[name], p.value, low, high, _covers(p, truth[name])),
                    *(p.cramer_rao_percent, p.insensitivity_percent),
                )
            )
    inside = sum(bool(row[6]) for row in rows)
    columns = (
        Column("parameter"),
        Column("unit"),
        Column("published = truth", digits=6),
        Column("estimate", digits=6),
        Column("95 % low", digits=6),
        Column("95 % high", digits=6),
        Column("covers"),
        Column("CR", "%", 2),
        Column("I", "%", 2),
    )
    note = f"{inside} of {len(rows)} intervals cover the truth; 19 of 20 should, over many flights."
    return Table("Table 3, with intervals", columns, tuple(rows), (note,))


def correlations(fit: fid.Fit) -> Table:
    """Correlations of the estimates."""
    rows = tuple(
        (name, *(round(float(r), 3) for r in row[: place + 1]), *[None] * (len(row) - place - 1))
        for place, (name, row) in enumerate(zip(fit.names, fit.correlation, strict=True))
    )
    heads = tuple(Column(name, digits=3) for name in fit.names)
    return Table("Correlations of the estimates", (Column("parameter"), *heads), rows)


def minima(fit: fid.Fit) -> Table:
    """Where the random starts ended."""
    best = fit.minima[0].objective
    rows = tuple(
        (place + 1, each.count, each.objective - best, *each.values.values(), each.termination)
        for place, each in enumerate(fit.minima)
    )
    heads = tuple(Column(name) for name in fit.minima[0].values)
    columns = (
        *(Column("minimum"), Column("starts"), Column("log-likelihood lost", digits=3)),
        *heads,
        Column("ended by"),
    )
    return Table(f"Random starts inside the bounds: {fit.model.name}", columns, rows)


def errors(measured: Mapping[str, Sequence[float | None]], noise_rad_s: float) -> Table:
    """Training and validation MSE as the study reports them.

    Parameters
    ----------
    measured : mapping of str to sequence of float or None
        By rate: training, validation on another sweep, validation on a doublet, (rad/s)².
    noise_rad_s : float
        Standard deviation of the gyro.
    """
    rows = [
        (rate, noise_rad_s**2, *measured[rate], each["training"], each["validation"])
        for rate, each in PUBLISHED["mse"].items()
    ]
    columns = (
        Column("rate"),
        Column("gyro noise²", digits=3),
        Column("training", digits=3),
        Column("other sweep", digits=3),
        Column("doublet", digits=3),
        Column("published training", digits=3),
        Column("published validation", digits=3),
    )
    notes = (
        "Mean square of measured minus modelled rate, (rad/s)²; the study prints no unit. Another "
        "sweep and a doublet validate: no fit has seen them.",
        "The right structure leaves the noise and nothing else, in training and validation alike.",
    )
    return Table("Mean squared errors", columns, tuple(rows), notes)


def couplings(attempts: Mapping[str, Attempt], truth: Mapping[str, float]) -> Table:
    """What different data say about the two couplings."""
    rows: list[tuple[Cell, ...]] = []
    for data, found in attempts.items():
        if isinstance(found, Refusal):
            rows.append((data, None, None, None, None, None, found.reason))
            continue
        both = [found.parameters[name] for name in COUPLINGS]
        cells = [cell for p in both for cell in (p.value, _half(p))]
        worst = np.max(np.abs(found.correlation - np.eye(len(found.names))))
        rows.append((data, *cells, float(worst), ""))
    columns = (
        Column("data"),
        Column("Lttheta", "rad/s²", 5),
        Column("±", digits=2),
        Column("Mtphi", "rad/s²", 5),
        Column("±", digits=2),
        Column("largest correlation", digits=3),
        Column("refused"),
    )
    published = " and ".join(f"{truth[name]:g}" for name in COUPLINGS)
    note = f"± is half a 95 % interval. Published: {published}, without any."
    return Table("What the data say about the couplings", columns, tuple(rows), (note,))


def domains(found: Identified, truth: Mapping[str, float]) -> Table:
    """The same sweeps in time and frequency domain."""
    rows: list[tuple[Cell, ...]] = []
    for box, fit in found.time.items():
        for name, p in fit.parameters.items():
            both = (p, found.frequency[box].parameters[name])
            cells = [cell for each in both for cell in (each.value, _half(each))]
            rows.append((name, truth[name], *cells))
    heads = [Column("time", digits=6), Column("±", digits=2)]
    heads += [Column("frequency", digits=6), Column("±", digits=2)]
    columns = (Column("parameter"), Column("truth", digits=6), *heads)
    note = (
        "Chirps as instruments in the frequency domain, 50 frequencies; the time domain uses every "
        "sample of both outputs and knows that their noise is white."
    )
    return Table("Time and frequency domain", columns, tuple(rows), (note,))


def rates_of_log(fits: Mapping[str, fid.Fit], truth: Mapping[str, float]) -> Table:
    """What keeping a quarter of the samples does."""
    names = list(truth)[:6]
    rows: list[tuple[Cell, ...]] = [("truth", *(truth[n] for n in names), None, None)]
    for data, fit in fits.items():
        tau = fit.parameters.get("tau")
        worst = max(
            abs(fit.parameters[n].value / truth[n] - 1.0) * 100.0 for n in names if truth[n]
        )
        values = [fit.parameters[n].value for n in names]
        rows.append((data, *values, None if tau is None else tau.value, worst))
    columns = (
        Column("log and fit"),
        *(Column(name, digits=5) for name in names),
        Column("tau", "s", 3),
        Column("worst error", "%", 2),
    )
    note = (
        "The autopilot moves its commands 400 times a second. From a log of 100 a second a fit can "
        "only guess what they did in between, and intervals do not know of a wrong guess."
    )
    return Table("Sampled at 100 Hz, as published", columns, tuple(rows), (note,))


def structures(fits: Mapping[str, fid.Fit], truth: Mapping[str, float]) -> Table:
    """The published structure fitted to a frame with motors and without couplings."""
    names = [*truth]
    rows: list[tuple[Cell, ...]] = [("truth", *truth.values(), None, None)]
    for structure, fit in fits.items():
        values = [fit.parameters[n].value if n in fit.parameters else None for n in names]
        own = [float(fit.records[place].rms[RATES[place]] ** 2) for place in (0, 1)]
        rows.append((structure, *values, *own))
    columns = (
        Column("structure"),
        *(Column(name, digits=4) for name in names),
        Column("training MSE of p", digits=3),
        Column("of q", digits=3),
    )
    printed = " and ".join(f"{PUBLISHED['mse'][rate]['training']:g}" for rate in RATES[:2])
    note = f"MSE in (rad/s)²; published in training: {printed}."
    return Table("A small MSE and a wrong model", columns, tuple(rows), (note,))


def doubts() -> Table:
    """What does not fit together in the published study."""
    rows = tuple((each["printed"], each["but"]) for each in PUBLISHED["doubt"])
    columns = (Column("printed"), Column("but"))
    return Table("The published tables, read with care", columns, rows)
