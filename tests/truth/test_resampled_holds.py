"""Held inputs and slow sensors on a coarser base: a delay stays what it was.

The truth is computed here: a lag under an input that is held, or straight, between its samples, by
16 substeps of each; and the transform of the hold, by hand.
"""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

import flightid as fid
from flightid.identification.told_hold import _judged
from flightid.record.checks import record_findings
from flightid.record.chosen_hold import ChosenHold
from tests.closeness import assert_close

Array = NDArray[np.float64]
STEP_S, SUBSTEPS, TAU_S, POLE, GAIN = 0.01, 16, 0.05, 2.2, 6.0
MODEL = fid.StateSpaceModel.from_dict(
    {
        "name": "yaw",
        "states": {"r": "rad/s"},
        "inputs": {"ped": "1"},
        "outputs": {"r": "r"},
        "parameters": {
            "Nr": {"value": -1.2, "unit": "1/s"},
            "Nped": {"value": 4.0, "unit": "1/s^2"},
            "tau": {"value": 0.03, "min": 0.0, "max": 0.4, "unit": "s"},
        },
        "equations": {"r'": "Nr*r+Nped*ped"},
        "delays": {"ped": "tau"},
    }
)


def commanded(hold: str, seed: int, n: int = 2000) -> Array:
    """Two levels for 0.2 s at least, or straight lines between corners as often."""
    corners = np.random.default_rng(seed).choice([-1.0, 1.0], n // 20 + 1)
    if hold == "zero":
        return np.repeat(corners, 20)[:n]
    return np.interp(np.arange(n), 20 * np.arange(corners.size), corners)


def answered(u: Array, hold: str) -> Array:
    """A lag of the input, late by tau, at the input's samples."""
    at = (np.arange(u.size * SUBSTEPS) + 0.5) / SUBSTEPS - TAU_S / STEP_S
    fine = u[np.maximum(np.floor(at).astype(int), 0)]
    if hold == "first":
        fine = np.interp(at, np.arange(u.size), u)
    keep = np.exp(-POLE * STEP_S / SUBSTEPS)
    x = np.zeros(fine.size + 1)
    for k, value in enumerate(fine):
        x[k + 1] = keep * x[k] + (1 - keep) * GAIN / POLE * value
    return x[:-1:SUBSTEPS]


def flown(hold: str, noise: float, seed: int = 1, runs: int = 1) -> fid.Record:
    u = commanded(hold, seed)
    y = answered(u, hold)
    y = y + noise * np.random.default_rng(seed + 50).standard_normal(y.size)
    y = y[np.arange(y.size) // runs * runs]
    return fid.Record.from_arrays(
        STEP_S * np.arange(u.size), inputs={"ped": u}, outputs={"r": y},
        units={"ped": "1", "r": "rad/s"}, hold=hold,
    )  # fmt: skip


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("new_s", [0.02, 0.04, 0.027])
def test_a_delay_behind_an_input_outlives_a_coarser_base(hold: str, new_s: float) -> None:
    record = fid.conditioning.resample(flown(hold, 0.05, seed=2), new_s)
    tau = fid.identify(MODEL, record).parameters["tau"]
    assert record.hold == "band_limited"
    assert tau.interval95[0] <= TAU_S <= tau.interval95[1]
    without_noise = fid.identify(MODEL, fid.conditioning.resample(flown(hold, 0.0), new_s))
    bias = without_noise.parameters["tau"].value - TAU_S
    assert abs(bias) < 6e-5, "half of an old sample is 5e-3"


@pytest.mark.parametrize("hold", ["zero", "first", None])
def test_a_low_pass_turns_a_sine_as_its_hold_does(hold: str | None) -> None:
    """A hold turns a sine by half a sample and gives sin(x)/x of it, straight lines its square."""
    time_s, omega = np.arange(1200) * STEP_S, 2 * np.pi * 8.0
    half = omega * STEP_S / 2
    size = {None: 1.0, "zero": np.sin(half) / half, "first": (np.sin(half) / half) ** 2}[hold]
    late_s = STEP_S / 2 if hold == "zero" else 0.0
    record = fid.Record.from_arrays(
        time_s,
        inputs={"u": np.sin(omega * time_s)},
        outputs={"y": np.sin(omega * time_s)},
        hold=hold,
    )
    for new_s in (0.02, 0.027):
        found = fid.conditioning.resample(record, new_s)
        inside = (found.time_s > 1.0) & (found.time_s < 11.0)
        late = size * np.sin(omega * (found.time_s - late_s))
        assert_close(found["u"][inside], late[inside], atol=3e-5, why="kernel, Gauss points")
        same = np.sin(omega * found.time_s)
        assert_close(found["y"][inside], same[inside], atol=3e-5, why="outputs are not held")


def test_a_held_column_is_read_on_a_coarser_grid_as_it_was_held(tmp_path: Path) -> None:
    made, path = flown("zero", 0.0), tmp_path / "flight.csv"
    columns = np.c_[made.time_s, made["ped"], made["r"]]
    np.savetxt(path, columns, delimiter=",", header="time,ped,r", comments="", fmt="%.9g")
    for hold in ("zero", None):
        (read,) = fid.read_records(
            path, inputs="ped", outputs="r", hold=hold, resample_to_s=0.03,
            units={"ped": "1", "r": "rad/s"},
        )  # fmt: skip
        again = fid.conditioning.resample(made, 0.03)
        assert read.hold == again.hold == "band_limited"
        assert_close(read["ped"], again["ped"], atol=1e-6, why="nine digits of the file")
        assert "low-pass 15 Hz, zero phase, of steps" in str(read.history[-1])


@pytest.mark.parametrize("runs", [2, 3])
@pytest.mark.parametrize("cut", [0, 1])
def test_a_sensor_that_repeats_its_values_is_taken_where_they_are_new(runs: int, cut: int) -> None:
    made = flown("zero", 0.01, runs=runs)
    made = made.segment(cut * STEP_S, 19.9)
    assert [f.code for f in record_findings(made)] == ["samples-repeated"]
    found = fid.conditioning.resample(made, runs * STEP_S)
    rows = np.rint(found.time_s / STEP_S).astype(int)
    assert not np.any(rows % runs)
    assert_close(found["r"], made["r"][rows - cut], atol=1e-15, why="copied")
    assert record_findings(found) == ()


def test_a_grid_between_rows_and_new_values_stays_amber() -> None:
    found = fid.conditioning.resample(flown("zero", 0.01, runs=3), 0.02)
    assert [f.code for f in record_findings(found)] == ["samples-repeated"]


def test_what_the_advice_on_repeated_samples_gives_is_true() -> None:
    record = fid.conditioning.resample(flown("zero", 0.05, runs=3), 0.03)
    low, high = fid.identify(MODEL, record).parameters["tau"].interval95
    assert low <= TAU_S <= high


def test_an_advised_file_is_no_longer_amber_for_what_was_mended(tmp_path: Path) -> None:
    made, path = flown("zero", 0.01, runs=2), tmp_path / "flight.csv"
    columns = np.c_[made.time_s, made["ped"], made["r"]]
    np.savetxt(path, columns, delimiter=",", header="time,ped,r", comments="", fmt="%.9g")
    told = {"inputs": "ped", "outputs": "r", "hold": "zero", "units": {"ped": "1", "r": "rad/s"}}
    for step_s, left in ((None, 1), (0.02, 0), (0.04, 0)):
        (read,) = fid.read_records(path, resample_to_s=step_s, **told)
        assert [f.code for f in record_findings(read)] == ["samples-repeated"] * left
        gap = fid.read_records(path, resample_to_s=step_s or 0.02, max_gap_s=0.025, **told)[0]
        assert [f.code for f in record_findings(gap)] == ["samples-repeated"]


def test_no_other_hold_is_advised_of_what_was_low_passed() -> None:
    """Of right words 1 of 7 is doubted there, and each declaration that followed was false."""
    better = SimpleNamespace(
        hold="zero", gain=3.1, parameter="tau", moved=38.0, by=", 0.039 s smaller", doubts=True
    )
    inputs = SimpleNamespace(model=SimpleNamespace(inputs=("ped",)))
    said = []
    for record in (made := flown("zero", 0.01), fid.conditioning.resample(made, 0.02)):
        rivals = SimpleNamespace(fit=inputs, records=[record])
        held = ChosenHold("band_limited", "record")
        finding, reached = _judged([better], held, rivals)  # type: ignore[arg-type, list-item]
        assert finding is not None
        assert (finding.code, reached) == ("hold-contradicted", [better])
        said.append((finding.message, finding.action))
    assert "declare hold='zero'" in said[0][1]
    assert said[1][0].startswith("inputs were low-passed to a coarser base, yet outputs fit better")
    assert "declare no other hold" in said[1][1]
