"""Damage in samples is named where a record enters and travels with it; health is silent."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.conditioning import remove_outliers
from flightid.conventions import Light
from flightid.evidence.data_checks import sample_checks
from flightid.record import Record
from flightid.record.checks import data_findings, record_findings
from flightid.vehicles import PilotDoublet, QuadrotorParameters, fly

N = 3000
TIME_S = np.arange(N) / 100.0
NOISE = np.random.default_rng(3).standard_normal((3, N))
ROLL = np.sin(1.3 * TIME_S) + 0.4 * np.sin(7.0 * TIME_S) + 0.02 * NOISE[0]


def spiked() -> np.ndarray:
    samples = ROLL.copy()
    samples[[400, 1500, 2600]] = 40.0
    return samples


def codes(samples: np.ndarray, unit: str = "1") -> list[tuple[str, Light]]:
    record = Record.from_arrays(TIME_S, outputs={"y": samples}, units={"y": unit})
    return [(finding.code, finding.light) for finding in record_findings(record)]


def smooth(*, frozen: bool = False) -> np.ndarray:
    """Without noise: steps of many levels through a lag that settles; it may freeze on its way."""
    levels = np.repeat(np.sin(np.arange(1.0, 16.0) ** 2), N // 15)
    samples = lfilter([0.0, 0.1], [1.0, -0.9], levels)
    if frozen:
        samples[1003 : 1003 + N // 5] = samples[1003]
    return np.asarray(samples)


def dead(share: float) -> np.ndarray:
    samples = ROLL.copy()
    samples[1000 : 1000 + int(share * N)] = samples[1000]
    return samples


def encoder(*, frozen: bool = False) -> np.ndarray:
    """Counts of an angle that rests and swings, read between their instants as resampling does."""
    swing = 40.0 * np.cos(np.pi * TIME_S / TIME_S[-1]) ** 2 * np.sin(2.0 * TIME_S)
    counts = np.round(swing + 0.3 * NOISE[2])
    samples = np.interp(TIME_S + 0.003 * np.sin(TIME_S), TIME_S, counts)
    if frozen:
        samples[314 : 314 + N // 5] = samples[314]
    return np.asarray(samples)


@pytest.mark.parametrize(
    ("samples", "unit", "found"),
    [
        (ROLL, "rad", []),
        (encoder(), "1", []),
        (encoder(frozen=True), "1", [("flat", Light.RED)]),
        (NOISE[0], "1", []),
        (np.round(20 * ROLL) / 20, "1", []),
        (np.sign(np.sin(1.3 * TIME_S)), "1", []),
        (np.cumsum(np.sign(NOISE[1])), "1", []),
        (np.sin(np.exp(0.15 * TIME_S)) * np.exp(0.1 * TIME_S), "1", []),
        (spiked(), "1", [("spikes", Light.RED)]),
        (ROLL + 3.0 * (np.arange(N) == 700), "1", [("spikes", Light.AMBER)]),
        (ROLL + 2 * np.pi * (np.arange(N) == 700), "rad", [("spikes", Light.AMBER)]),
        (dead(0.02), "1", [("flat", Light.AMBER)]),
        (dead(0.2), "1", [("flat", Light.RED)]),
        (smooth(), "1", []),
        (np.round(smooth(), 7), "1", []),
        (smooth(frozen=True), "1", [("flat", Light.RED)]),
        (np.repeat(ROLL[::5], 5), "1", [("samples-repeated", Light.AMBER)]),
        (np.clip(ROLL, -1.2, 1.2), "1", [("clipped", Light.RED)]),
        (np.mod(0.7 * TIME_S, 2 * np.pi), "rad", [("wrapped", Light.RED)]),
        (np.mod(40.0 * TIME_S, 360.0), "deg", [("wrapped", Light.RED)]),
    ],
)
def test_damage_has_a_name_and_health_has_none(
    samples: np.ndarray, unit: str, found: list[tuple[str, Light]]
) -> None:
    assert codes(samples, unit) == found


def test_a_command_that_is_held_is_no_slow_measurement() -> None:
    clocked = np.repeat(np.sign(NOISE[2, : N // 12]), 12)
    three = np.repeat(np.random.default_rng(5).integers(-1, 2, N // 12), 12).astype(float)
    random, slow = np.repeat(NOISE[1, : N // 12], 12), np.repeat(ROLL[::12], 12)
    columns = {"clocked": clocked, "three": three, "random": random, "slow": slow}
    untold = record_findings(Record.from_arrays(TIME_S, others=columns))
    # What neither its role nor its levels tell may be either, and the sentence says so.
    assert [each.message.split()[0] for each in untold] == ["random", "slow"]
    assert all("held as a command is, or measured 12 times slower" in f.message for f in untold)
    assert record_findings(Record.from_arrays(TIME_S, inputs=columns)) == ()
    assert record_findings(Record.from_arrays(TIME_S, excitations=columns)) == ()
    told = record_findings(Record.from_arrays(TIME_S, outputs=columns))
    assert [each.message.split()[0] for each in told] == ["three", "random", "slow"]
    assert not any("command" in each.message for each in told)


def test_a_pulse_between_the_levels_of_an_input_is_no_spike() -> None:
    pulses = np.where(np.arange(N) % 400 == 7, 1.0, -1.0)
    record = Record.from_arrays(TIME_S, inputs={"u": pulses})
    assert record_findings(record) == ()
    beyond = Record.from_arrays(TIME_S, inputs={"u": np.where(np.arange(N) == 50, 99.0, ROLL)})
    assert [finding.code for finding in record_findings(beyond)] == ["spikes"]


def flown(log_every: int, **damaged: np.ndarray) -> Record:
    """A flight whose pilot steps the stick: the derivative throws the torque for a few samples."""
    doublet = PilotDoublet("roll", start_s=2.0, amplitude=0.2, width_s=0.8)
    quick = QuadrotorParameters(maximum_thrust_n=23.0, motor_lag_s=0.03)
    flight = fly(
        duration_s=8.0, doublets=[doublet], vehicle=quick, log_every=log_every, seed=13
    ).record()
    groups = {
        group: {name: damaged.get(name, flight[name]) for name in names}
        for group, names in (("inputs", flight.inputs), ("outputs", flight.outputs))
    }
    return Record.from_arrays(flight.time_s, **groups)  # type: ignore[arg-type]


@pytest.mark.parametrize("log_every", [4, 8, 16])
def test_the_edges_of_a_pilots_doublet_are_no_spikes_and_damage_still_is(log_every: int) -> None:
    healthy = flown(log_every)
    assert record_findings(healthy) == ()
    place = healthy.n_samples - 60 // log_every - 20
    for name in ("tau_phi", "p"):
        hit = np.array(healthy[name])
        hit[place : place + 2] += 3.0 * np.ptp(hit)
        (found,) = record_findings(flown(log_every, **{name: hit}))
        assert found.code == "spikes"
        assert f" of {name} " in found.message


def test_a_lone_pulse_of_two_samples_is_not_several_of_one_height() -> None:
    pulse = np.where(np.isin(np.arange(N), [50, 51]), 99.0, ROLL)
    record = Record.from_arrays(TIME_S, inputs={"u": pulse})
    assert [finding.code for finding in record_findings(record)] == ["spikes"]


def test_a_quick_output_answers_steps_but_damage_that_a_loop_answers_is_damage() -> None:
    steps = np.repeat(np.sign(np.sin(np.arange(1.0, 11.0) ** 2)), N // 10)
    answer = lfilter([0.0, 1.0, -1.0], [1.0, -0.3], steps - steps[0]) + 0.002 * NOISE[0]
    rig = Record.from_arrays(TIME_S, inputs={"u": steps}, outputs={"y": answer})
    assert record_findings(rig) == ()
    hit = np.where(np.isin(np.arange(N), [700, 1900]), 5.0, 0.1 * NOISE[1])
    fed_back = lfilter([-0.5], [1.0, -0.6], hit)
    loop = Record.from_arrays(TIME_S, inputs={"u": fed_back}, outputs={"y": hit})
    assert "spikes" in [finding.code for finding in record_findings(loop, ["y"])]


@pytest.mark.parametrize(
    ("factor", "wrong"), [(1.0, False), (180 / np.pi, True), (np.pi / 180, True)]
)
def test_degrees_beside_radians_are_seen_without_a_unit(factor: float, wrong: bool) -> None:
    rate = np.gradient(ROLL - 0.02 * NOISE[0], TIME_S) + 0.05 * NOISE[1] + 0.01
    record = Record.from_arrays(
        TIME_S, outputs={"phi": ROLL, "p": factor * rate}, units={"phi": "rad", "p": "rad/s"}
    )
    found = [finding.code for finding in record_findings(record)]
    assert found == (["units-swapped"] if wrong else [])


def test_findings_are_those_of_the_rows_and_survive_filters(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    table = np.column_stack([TIME_S, NOISE[2], spiked()])
    np.savetxt(path, table, delimiter=",", header="time [s],u,p [rad/s]", comments="")
    slow = {"inputs": "u", "outputs": "p", "resample_to_s": 0.05}
    (record,) = fid.read_records(path, **slow)  # type: ignore[arg-type]
    assert [finding.code for finding in record_findings(record)] == ["spikes"]
    assert record_findings(record, ["u"]) == ()
    # The low-pass of the new grid spread them by 1.65 s; beyond that they leave nothing.
    assert record_findings(record.segment(5.0, 14.0)) == record_findings(record)
    assert record_findings(record.segment(6.0, 13.0)) == ()
    assert record_findings(record.segment(28.0, 30.0)) == ()
    fid.write_records([record], tmp_path / "kept.parquet")
    (stored,) = fid.read_records(tmp_path / "kept.parquet")
    assert record_findings(stored) == record_findings(record)
    (clean,) = fid.read_records(path, outliers={"deviations": 40.0}, **slow)  # type: ignore[arg-type]
    assert record_findings(clean) == ()
    (whole,) = fid.read_records(path, inputs="u", outputs="p")
    (said,) = record_findings(whole)
    advised = float(said.action.split("deviations = ")[1].split()[0])
    assert record_findings(remove_outliers(whole, deviations=advised)) == ()


def test_findings_reach_responses_and_the_evidence_of_fits() -> None:
    good = Record.from_arrays(TIME_S, inputs={"u": NOISE[2]}, outputs={"y": ROLL})
    bad = Record.from_arrays(TIME_S, inputs={"u": NOISE[2]}, outputs={"y": spiked()})
    response = fid.estimate_response([good, bad], window_s=5.0)
    assert [finding.code for finding in data_findings(response.history)] == ["spikes"]
    fit = fid.identify(fid.PolynomialModel.arx("u", "y", na=1, nb=1, nk=1), bad)
    (check,) = [check for check in fit.evidence.checks if check.name == "samples"]
    assert check.light is Light.RED
    worse = Record.from_arrays(TIME_S, inputs={"u": NOISE[2]}, outputs={"y": 2.0 * spiked()})
    (one,), (two,) = sample_checks([good, bad], {"y"}), sample_checks([good, bad, worse], {"y"})
    assert "records 1 and 2 hold the same" in one.what
    assert two.what == one.what.replace("1 other finding", "2 other findings")
    assert sample_checks([good], {"y"}) == []


def test_one_spike_is_told_as_one_and_several_as_several() -> None:
    told = {}
    for at in ([700], [700, 1900]):
        samples = ROLL.copy()
        samples[at] += 30.0
        (found,) = record_findings(Record.from_arrays(TIME_S, outputs={"phi": samples}))
        told[len(at)] = f"{found.message} {found.action}"
    assert "1 sample of phi stands alone, 30" in told[1]
    assert "from its neighbours (" in told[1]
    assert "look for its cause" in told[1]
    assert "from the neighbours at most (" in told[2]
    assert "look for their cause" in told[2]
