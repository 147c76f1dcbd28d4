"""The paper's tables 2 to 7 with what the flights gave beside the published figures."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from flights import LIBRARY
from identification import Identified

import flightid as fid
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Reading

PUBLISHED = tomllib.loads(Path(__file__).with_name("published.toml").read_text(encoding="utf-8"))


def of_condition(condition: str, found: Identified) -> list[Table]:
    """Tables 2 to 7 of one flight condition."""
    return [
        responses(condition, found.fit),
        parameters(condition, found.fit),
        eigenvalues(condition, found.fit),
    ]


def responses(condition: str, fit: fid.Fit) -> Table:
    """Tables 2 and 3: the bands that coherence selected, and the costs."""
    published = PUBLISHED[condition]
    rows: list[tuple[Cell, ...]] = []
    for each in fit.responses:
        theirs = published["ranges"].get(each.name, (None, None))
        rows.append((each.name, *each.band_rad_s, *theirs, each.cost))
    columns = (
        Column("response"),
        Column("from", "rad/s", 3),
        Column("to", "rad/s", 3),
        Column("published from", "rad/s"),
        Column("to", "rad/s"),
        Column("cost", digits=3),
    )
    unused = sorted(set(published["ranges"]) - set(fit.costs))
    notes = (
        f"Average cost {fit.average_cost:.1f}; published {published['average_cost']}, from flights "
        "with whatever a linear model lacks.",
        "Published, not coherent enough here: " + (", ".join(unused) or "none") + ".",
    )
    return Table(f"Tables 2 and 3, {condition}: responses and costs", columns, tuple(rows), notes)


def parameters(condition: str, fit: fid.Fit) -> Table:
    """Tables 4 and 5: estimates beside the published values, which are the truth here."""
    truth = fid.load_model(LIBRARY[condition]).parameters
    columns = (
        Column("parameter"),
        Column("unit"),
        Column("published = truth"),
        Column("estimate"),
        Column("95 % low", digits=3),
        Column("95 % high", digits=3),
        Column("covers"),
        Column("CR", "%", 3),
        Column("published CR", "%"),
        Column("I", "%", 3),
        Column("published I", "%"),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, (bound, insensitivity) in PUBLISHED[condition]["parameters"].items():
        p, value = fit.parameters[name], truth[name].value
        low, high = p.interval95 or (None, None)
        covers = None if low is None or high is None or value is None else low <= value <= high
        rows.append(
            (
                *(name, p.unit, value, p.value, low, high, covers),
                *(p.cramer_rao_percent, bound, p.insensitivity_percent, insensitivity),
            )
        )
    inside, of = covered(condition, fit)
    note = f"{inside} of {of} intervals cover the truth; about {0.95 * of:.0f} should."
    return Table(f"Tables 4 and 5, {condition}: parameters", columns, tuple(rows), (note,))


def covered(condition: str, fit: fid.Fit) -> tuple[int, int]:
    """How many 95 % intervals of free parameters cover the published value, and of how many."""
    truth = fid.load_model(LIBRARY[condition]).parameters
    inside = [
        p.interval95[0] <= (truth[name].value or 0.0) <= p.interval95[1]
        for name, p in fit.parameters.items()
        if p.status == "free" and p.interval95 is not None
    ]
    return sum(inside), len(inside)


def eigenvalues(condition: str, fit: fid.Fit) -> Table:
    """Tables 6 and 7: modes of the identified model beside the published ones."""
    left = list(fid.modes(fit))
    rows: list[tuple[Cell, ...]] = []
    for real, imaginary, description in PUBLISHED[condition]["eigenvalues"]:
        place = complex(real, imaginary)
        nearest = min(left, key=lambda mode: abs(mode.root - place))
        left.remove(nearest)
        numbers = [
            cell
            for each in (
                nearest.real,
                nearest.imaginary,
                nearest.natural_frequency,
                nearest.damping_ratio,
            )
            for cell in (each.value, half(each))
        ]
        rows.append((description, real, imaginary, *numbers, nearest.name))
    columns = (
        Column("published mode"),
        Column("published real", "rad/s"),
        Column("imaginary", "rad/s"),
        Column("real", "rad/s"),
        Column("±", "rad/s", 2),
        Column("imaginary", "rad/s"),
        Column("±", "rad/s", 2),
        Column("natural frequency", "rad/s"),
        Column("±", "rad/s", 2),
        Column("damping ratio", digits=3),
        Column("±", digits=2),
        Column("what takes part here"),
    )
    number = 6 if condition == "hover" else 7
    others = ", ".join(f"{mode.name} {mode.root.real:.2g}" for mode in left) or "none"
    notes = ("± is half a 95 % interval, from the parameters' covariance.", f"Others: {others}.")
    return Table(f"Table {number}, {condition}: eigenvalues", columns, tuple(rows), notes)


def half(quantity: Reading) -> float | None:
    """Half of a 95 % interval."""
    interval = quantity.interval95
    return None if interval is None else (interval[1] - interval[0]) / 2.0


def of_both(both: Mapping[str, Identified]) -> list[Table]:
    """Ratios of cruise to hover, modes side by side, and the physics."""
    compared = fid.compare_conditions({name: found.fit for name, found in both.items()})
    rotors = [rotor(condition, found.fit) for condition, found in both.items()]
    return [ratios(compared), compared.modes_table(), *rotors]


def ratios(compared: fid.ConditionComparison) -> Table:
    """Last column of tables 4 and 5: what changes from hover to cruise."""
    truths = {name: fid.load_model(LIBRARY[name]).parameters for name in compared.conditions}
    rows: list[tuple[Cell, ...]] = []
    for number in compared.parameters:
        name, ratio = number.name, number.ratios["cruise"]
        if name not in PUBLISHED["hover"]["parameters"]:
            continue
        published = (truths["cruise"][name].value or 0.0) / (truths["hover"][name].value or 1.0)
        low, high = ratio.interval95 or (None, None)
        rows.append((name, published, ratio.value, low, high, number.chances.get("cruise")))
    columns = (
        Column("parameter"),
        Column("published", digits=3),
        Column("identified", digits=3),
        Column("95 % low", digits=3),
        Column("95 % high", digits=3),
        Column("chance", digits=2),
    )
    notes = ("chance: of so large a change between equal truths.", *compared.verdicts)
    return Table("Cruise over hover", columns, tuple(rows), notes)


def rotor(condition: str, fit: fid.Fit) -> Table:
    """Time constants, Lock numbers, flapping frequencies and gearing, as the paper does."""
    facts = PUBLISHED["physics"]
    expected = {f"{axis} gearing": facts["gearing"] for axis in ("lateral", "longitudinal")}
    if condition == "hover":
        # Theory from the blade's Lock number, corrected for inflow, and from the bar's.
        expected |= {
            "rotor time constant": facts["theory_tau_f"],
            "bar time constant": facts["theory_tau_s"],
        }
    speed = facts["rotor_speed_rpm"] * 2.0 * np.pi / 60.0
    found = fid.rotor_physics(fit, speed, expected=expected)
    table = found.summary()
    gearing = ", ".join(f"{k} {v}" for k, v in PUBLISHED[condition]["gearing"].items())
    printed = [f"{name} {value}" for name, value in PUBLISHED[condition].get("damping", {}).items()]
    notes = [f"The paper's gearing from its own fit: {gearing}; ours is the ratio of its table."]
    if printed:
        notes.append(f"The paper's damping ratios 1/(2 tau_s omega): {', '.join(printed)}.")
    return Table(f"Physics, {condition}", table.columns, table.rows, (*table.notes, *notes))
