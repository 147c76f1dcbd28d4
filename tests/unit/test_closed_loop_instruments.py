"""ARX and OE by instruments in a closed loop, on a loop that NumPy alone runs."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.models.polynomial.structure import PolynomialStructure
from tests.closeness import assert_close

TRUTH = {"a1": -1.5, "a2": 0.7, "f1": -1.5, "f2": 0.7, "b1": 0.5, "b2": 0.3}
GAIN, COLOUR = 0.35, 0.9


def looped(seed: int, *, n: int = 2000, noise: float = 0.3, shown: bool = True) -> fid.Record:
    """u = r - K y under an ARX vehicle whose output carries slow noise."""
    rng = np.random.default_rng(seed)
    r = np.repeat(rng.choice([-1.0, 1.0], n // 4 + 1), 4)[:n]
    white, drift = noise * rng.standard_normal(n), np.zeros(n)
    x, y, u = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(2, n):
        drift[k] = COLOUR * drift[k - 1] + white[k]
        x[k] = 1.5 * x[k - 1] - 0.7 * x[k - 2] + 0.5 * u[k - 1] + 0.3 * u[k - 2]
        y[k] = x[k] + drift[k]
        u[k] = r[k] - GAIN * y[k]
    return fid.Record.from_arrays(
        np.arange(n) * 0.1,
        inputs={"u": u},
        outputs={"y": y},
        excitations={"r": r} if shown else {},
        loop="closed",
    )


ARX = fid.PolynomialModel.arx("u", "y", na=2, nb=2, nk=1, method="iv4")
OE = fid.PolynomialModel.oe("u", "y", nb=2, nf=2, nk=1, method="riv")

PLAIN = replace(OE, method="prediction_error")


def departures(structure: PolynomialStructure, seed: int) -> np.ndarray:
    found = fid.identify(structure, looped(seed)).parameters
    errors = {n: found[n].stderr or np.nan for n in structure.names}
    return np.array([(found[n].value - TRUTH[n]) / errors[n] for n in structure.names])


@pytest.mark.parametrize("structure", [ARX, OE], ids=["arx", "oe"])
def test_the_excitation_takes_the_bias_of_the_loop_away(structure: PolynomialStructure) -> None:
    """Instruments made of inputs carry the noise and get no bars; those of the excitation do."""
    if structure is ARX:
        assert fid.identify(structure, looped(0, shown=False)).covariance is None
    else:
        with pytest.raises(DataError, match="the records do not tell what was injected"):
            fid.identify(structure, looped(0, shown=False))
        direct = fid.identify(PLAIN, looped(0, shown=False))
        # Noise that comes back through the loop pulls the plain fit: by -0.047 in the mean.
        assert direct.parameters["b1"].value < TRUTH["b1"] - 0.02
        assert direct.covariance is None
        assert ("loop-biases", "amber") in {(f.code, str(f.light)) for f in direct.findings}
    all_of = [departures(structure, seed) for seed in range(4)]
    assert np.abs(np.mean(all_of, axis=0)).max() < 1.5


def test_output_error_takes_what_was_injected_by_itself() -> None:
    """With the loop declared, or seen; noise far above the answer hides nothing from it."""
    record = looped(3)
    asked, taken = fid.identify(OE, record), fid.identify(PLAIN, record)
    assert taken.structure.method == "riv"
    for name in OE.names:
        assert taken.parameters[name].value == asked.parameters[name].value
        assert taken.parameters[name].stderr == asked.parameters[name].stderr
    loop = taken.evidence.check("loop")
    assert loop is not None
    assert str(loop.light) == "green"
    seen = fid.identify(PLAIN, looped(0, noise=1.5).declare(loop=None))
    assert seen.covariance is not None
    assert "nothing-told" not in {finding.code for finding in seen.findings}
    assert fid.identify(PLAIN, record, loop="open").structure.method == "prediction_error"


@pytest.mark.parametrize("structure", [ARX, OE], ids=["arx", "oe"])
def test_without_noise_both_find_the_vehicle(structure: PolynomialStructure) -> None:
    found = fid.identify(structure, looped(1, noise=0.0)).parameters
    for name in structure.names:
        assert_close(found[name].value, TRUTH[name], atol=1e-6, why="no noise, exact model")


@pytest.mark.parametrize("structure", [ARX, OE], ids=["arx", "oe"])
def test_a_loop_that_the_excitation_takes_care_of_is_no_doubt(
    structure: PolynomialStructure,
) -> None:
    """The record says that the loop was closed; the advice was to do what had been done."""
    (check,) = [c for c in fid.identify(structure, looped(2)).evidence.checks if c.name == "loop"]
    assert check.light is Light.GREEN
    assert "by way of the excitation" in check.what
    plain = replace(structure, method="prediction_error")
    direct = fid.identify(plain, looped(2, shown=False))
    (check,) = [c for c in direct.evidence.checks if c.name == "loop"]
    assert check.light is Light.AMBER


def test_refined_instruments_belong_to_output_error() -> None:
    with pytest.raises(OptionError, match="refined instruments belong to output error"):
        fid.PolynomialModel.bj("u", "y", nb=2, nf=2, nc=1, nd=1, nk=1, method="riv")


def test_a_command_takes_what_was_injected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record, file = looped(2), tmp_path / "loop.csv"
    rows = np.column_stack([record.time_s, *(record[name] for name in ("u", "y", "r"))])
    np.savetxt(file, rows, delimiter=",", header="time,u,y,r", comments="")
    told = ["--inputs", "u", "--outputs", "y", "--loop", "closed"]
    for kind, structure in (("arx", ARX), ("oe", OE)):
        asked = ["identify", str(file), "--kind", kind, *told, "--excitation", "r", "--json"]
        assert run(asked) == 0
        found = json.loads(capsys.readouterr().out)["parameters"]
        expected = fid.identify(structure, record).parameters
        for name in structure.names:
            assert found[name]["value"] == pytest.approx(expected[name].value, rel=1e-6)
            assert found[name]["stderr"] is not None
    np.savetxt(file, rows, delimiter=",", header="time,tau_phi,p [rad/s],r", comments="")
    asked = ["identify", str(file), "--model", "rate_first_order", "--method", "output_error"]
    assert run([*asked, "--hold", "zero", "--excitation", "r"]) == 1
    assert "is no option" not in capsys.readouterr().err
    np.savetxt(file, rows, delimiter=",", header="time,u,y,r", comments="")
    assert run(["identify", str(file), "--kind", "bj", *told, "--excitation", "r"]) == 2
    assert "arx (method iv4), oe (method riv); bj has a noise model" in capsys.readouterr().err


@pytest.mark.nightly
@pytest.mark.parametrize("structure", [ARX, OE], ids=["arx", "oe"])
def test_intervals_hold_the_vehicle_as_often_as_they_say(structure: PolynomialStructure) -> None:
    inside = np.abs([departures(structure, seed) for seed in range(300)]) < 1.96
    assert 0.92 < inside.mean() < 0.975
