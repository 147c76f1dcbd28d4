"""Records that contradict a model's own bars, and those that do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.conventions import Light
from flightid.identification.prediction.predict import predictor_of
from flightid.identification.prediction.request import FREE_RUN, Request
from flightid.identification.prediction.result import Prediction
from flightid.identification.withheld_intervals import without_intervals
from flightid.validation.verification.contradiction import CODE, contradictions

TIME_S = np.arange(800) / 20.0


def flown(seed: int, gain: float, *, noise: float = 0.05, name: str = "flown") -> fid.Record:
    random = np.random.default_rng(seed)
    u = np.repeat(np.sign(random.standard_normal(160)), 5)
    y = lfilter([0.0, 0.2 * gain], [1.0, -0.8], u) + noise * random.standard_normal(u.size)
    return fid.Record.from_arrays(TIME_S, inputs={"u": u}, outputs={"y": y}, name=name)


STRUCTURES = (
    fid.PolynomialModel.oe("u", "y", nb=1, nf=1),
    fid.InnovationsModel.subspace("u", "y", order=1),
)


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize(
    ("gain", "noise", "light"),
    [(1.0, 0.05, None), (1.0, 0.08, None), (1.25, 0.05, Light.AMBER), (2.5, 0.05, Light.RED)],
)
def test_a_record_beyond_the_bars_is_not_green(
    structure: object, gain: float, noise: float, light: Light | None, tmp_path: Path
) -> None:
    fit = fid.identify(structure, flown(1, 1.0))
    told = flown(2, gain, noise=noise)
    fid.write_model(fit, tmp_path / "model.toml")
    for source in (fit, fid.load_model(tmp_path / "model.toml")):
        found = [each.light for each in fid.verify(source, told).findings if each.code == CODE]
        assert found == ([] if light is None else [light])


def test_nothing_is_said_of_intervals_that_there_are_not() -> None:
    bare = without_intervals(fid.identify(STRUCTURES[0], flown(1, 1.0)), "withheld")
    (found,) = (each for each in fid.verify(bare, flown(2, 2.5)).findings if each.code == CODE)
    assert found.light is Light.AMBER
    assert "intervals of this model do not hold" not in found.message


def test_of_a_right_model_in_gusts_nothing_is_said_of_intervals() -> None:
    """Errors that no input foretells may be gusts beyond those of the fit: bars hold in these."""

    def in_rad_s(record: fid.Record) -> fid.Record:
        rows = {name: record[name] for name in ("u", "y")}
        return fid.Record.from_arrays(
            TIME_S, inputs={"u": rows["u"]}, outputs={"y": rows["y"]}, units={"y": "rad/s"}
        )

    fit = fid.identify(STRUCTURES[0], in_rad_s(flown(1, 1.0)))
    for gain, contradicted in ((1.0, False), (2.5, True)):
        gusty = in_rad_s(flown(2, gain, noise=0.3))
        (found,) = (each for each in fid.verify(fit, gusty).findings if each.code == CODE)
        assert ("intervals of this model do not hold" in found.message) is contradicted
        assert ("inputs foretell none of the errors" in found.message) is not contradicted


def test_bars_of_the_parameters_allow_for_what_the_fit_could_not_tell() -> None:
    short = flown(3, 1.0, noise=3.0)
    fit = fid.identify(STRUCTURES[0], short.segment(0.0, 10.0))
    assert not [each for each in fid.verify(fit, flown(4, 1.2)).findings if each.code == CODE]


def test_what_bars_allow_is_of_all_outputs_together_as_the_run_was() -> None:
    """One output alone told so little of start and biases that any error was allowed."""

    def two(seed: int, gain: float) -> fid.Record:
        made = flown(seed, gain)
        rows = {"y": made["y"], "z": flown(seed + 10, 0.0)["y"] - made["y"]}
        return fid.Record.from_arrays(TIME_S, inputs={"u": made["u"]}, outputs=rows)

    fit = fid.identify(fid.InnovationsModel.subspace("u", ("y", "z"), order=1), two(1, 1.0))
    model, way = predictor_of(fit)
    asked = []

    def watched(
        model: object, record: fid.Record, outputs: tuple[str, ...], request: Request
    ) -> Prediction:
        asked.append(outputs)
        return way(model, record, outputs, request)

    request = Request(FREE_RUN)
    run = way(model, two(2, 2.5), ("y", "z"), request)
    said = [each.light for each in contradictions(fit, watched, [run], request)]
    assert said == [Light.RED, Light.RED]
    assert set(asked) == {("y", "z")}
