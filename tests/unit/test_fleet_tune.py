"""Gains straight from a catalogue: the type pooled from the files of its flights' models."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from flightid.cli.tune import command
from flightid.errors import DataError
from flightid.fleet import type_models
from flightid.fleet.catalogue.loose import write_loose
from flightid.fleet.opening import catalogue_place, current_store
from flightid.fleet.settings import read_fleet
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.population import estimate_population
from flightid.models.load import load_model
from flightid.models.save import model_as_toml
from tests.fleet_types import ERRORS, FLIGHTS, MEAN, NAMES, VEHICLES, fleet_of, record, values

pytest.importorskip("duckdb")


def test_the_pooled_model_is_that_of_the_estimates(tmp_path: Path) -> None:
    found = type_models(fleet_of(tmp_path, "quad"))["Roll"]
    truth = estimate_population(
        FlightEstimates.of(
            NAMES,
            np.repeat([*"abcdefgh"], FLIGHTS).tolist(),
            values(),
            np.tile(np.diag(ERRORS**2), (VEHICLES * FLIGHTS, 1, 1)),
        )
    )
    means = dict(zip(truth.names, truth.spreads.mean, strict=True))
    for name in NAMES:
        assert found.parameters[name].value == pytest.approx(means[name], rel=1e-4)
    order = [found.estimated.names.index(name) for name in NAMES]
    covariance = found.estimated.covariance[np.ix_(order, order)]
    np.testing.assert_allclose(
        np.sqrt(np.diag(covariance)), np.sqrt(np.diag(truth.next_covariance)), rtol=5e-3
    )
    assert found.estimated.bands == {"p/tau_phi": (pytest.approx(1.25), 90.0)}
    assert found.estimated.provenance["flights"] == VEHICLES * FLIGHTS
    assert max(found.estimated.model_errors["p/tau_phi"]["bound"]) == pytest.approx(0.05)


def test_a_joint_fit_takes_the_points_of_the_catalogue(tmp_path: Path) -> None:
    """Points without noise lie on the fits: what is estimated is the mean of these."""
    fleet = fleet_of(tmp_path, "quad")
    joint, apart = (type_models(fleet, joint=each)["Roll"] for each in (True, False))
    for name in NAMES:
        assert joint.parameters[name].value == pytest.approx(apart.parameters[name].value, rel=0.05)
        assert joint.parameters[name].value != apart.parameters[name].value
    assert joint.estimated.bands == apart.estimated.bands


def test_tune_takes_a_fleet_file_and_the_folder_of_its_catalogue(tmp_path: Path) -> None:
    fleet = fleet_of(tmp_path, "quad")
    options = ["--controller", "pi_d", "--draws", "20"]
    done = CliRunner().invoke(command, [str(fleet), *options, "--json"])
    assert "Roll: 16 flights of 8 vehicles, pooled" in done.stderr, done.output
    said = json.loads(done.stdout)
    assert len(said["designs"]) == 1
    assert "pooled-apart" not in str(said)
    # One place either way: what is pooled cannot differ.
    folder = tmp_path / "fleet-catalogue"
    assert catalogue_place(folder) == catalogue_place(fleet)
    # Vehicles that the report calls unlike their type were pooled without a word.
    store = current_store(read_fleet(fleet))
    for number in (92, 93):
        write_loose(store, record(number, values()[0] * [2.0, 1.0, 1.0, 1.0], "quad"))
    done = CliRunner().invoke(command, [str(folder), *options])
    said_too = " ".join(done.output.split())
    assert "Roll: 18 flights of 9 vehicles, pooled" in said_too
    assert "[amber] pooled with the others though apart from them: quad46: " in said_too
    assert "a type of their own in the table of [vehicles]" in said_too


def test_a_type_must_be_told_where_there_are_several(tmp_path: Path) -> None:
    fleet = fleet_of(tmp_path, "hexa", "quad")
    with pytest.raises(DataError, match=r"several types.*hexa, quad"):
        type_models(fleet)
    with pytest.raises(DataError, match="no type to be pooled"):
        type_models(fleet, type_name="octa")
    assert type_models(fleet, type_name="hexa").keys() == {"Roll"}
    wrong = CliRunner().invoke(command, [str(tmp_path), "--type", "quad"])
    assert "--type belongs to a fleet" in wrong.output
    two = CliRunner().invoke(command, [str(fleet), str(fleet)])
    assert "tuned alone" in two.output


def test_flights_of_different_structures_are_not_pooled(tmp_path: Path) -> None:
    fleet = fleet_of(tmp_path, "quad")
    store = current_store(read_fleet(fleet))
    odd = record(91, MEAN, "quad")
    odd.rows["models"][0]["file"] = model_as_toml(load_model("rate_first_order", axis="roll"))
    write_loose(store, odd)
    with pytest.raises(DataError, match="different structures"):
        type_models(fleet)
