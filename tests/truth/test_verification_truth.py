"""Verification against systems whose answer is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid import validation
from flightid.models.linear.linear_system import LinearSystem
from tests.closeness import assert_close

TIME_S = np.arange(600) * 0.02
STEP = np.where((TIME_S > 1.0) & (TIME_S < 3.0), 1.0, np.where(TIME_S < 5.0, -0.5, 0.0))
LAG = LinearSystem([[-2.0]], [[3.0]], [[1.0]], [[0.0]], ("u",), ("p",), [0.05])


def _flown(model: LinearSystem, *, units: str = "rad/s", **options: object) -> fid.Record:
    record = fid.Record.from_arrays(TIME_S, inputs={"u": STEP})
    named = dict.fromkeys(model.outputs, units)
    return fid.simulate(model, record, units=named, **options)  # type: ignore[arg-type]


def test_the_truth_predicts_itself_with_every_shift_recovered() -> None:
    seen = _flown(LAG, initial_state=[0.7])
    answer = (0.4 / 2.0) * (1 - np.exp(-2.0 * TIME_S))
    record = seen.replace({"p": seen["p"] + answer + 0.25})
    result = fid.verify(LAG, record, initial_state="estimate")
    shifts = result.predictions[0].shifts
    assert_close(result.rms_error["p"], 0.0, atol=1e-12, why="the model is the truth")
    # A bias b, an initial state and a reference shift act through two shapes only: a constant and
    # exp(-2 t). The free run is unique, the split is not.
    assert (shifts.n_free, shifts.rank) == (3, 2)
    at_rest = shifts.output_bias[0] + shifts.state_bias[0] / 2.0
    decay = shifts.initial_state[0] - shifts.state_bias[0] / 2.0
    assert_close(at_rest, 0.25 + 0.2, rtol=1e-9, why="the constant part is unique")
    assert_close(decay, 0.7 - 0.2, rtol=1e-9, why="the decaying part is unique")
    assert "verification-start-untold" not in {finding.code for finding in result.findings}


def test_bias_and_reference_alone_are_unique() -> None:
    seen = _flown(LAG)
    answer = (0.4 / 2.0) * (1 - np.exp(-2.0 * TIME_S))
    record = seen.replace({"p": seen["p"] + answer + 0.25})
    result = fid.verify(LAG, record, initial_state="trim")
    shifts = result.predictions[0].shifts
    assert_close(shifts.state_bias, [0.4], rtol=1e-9, why="what was added to the state derivative")
    assert_close(shifts.output_bias, [0.25], rtol=1e-9, why="what was added to the output")
    assert np.all(shifts.initial_state == 0)


def test_without_free_shifts_the_offset_is_an_error() -> None:
    seen = _flown(LAG)
    record = seen.replace({"p": seen["p"] + 0.25})
    result = fid.verify(LAG, record, initial_state="trim", state_bias=False, output_bias=False)
    assert_close(result.rms_error["p"], 0.25, rtol=1e-9, why="a constant error")
    assert_close(result.mse["p"], 0.0625, rtol=1e-9, why="its square")
    assert_close(result.vaf["p"], 100.0, rtol=1e-9, why="blind to a constant")
    spread = float(np.std(seen["p"]))
    assert_close(result.fit_percent["p"], 100 * (1 - 0.25 / spread), rtol=1e-9, why="by definition")


def test_declared_trim_is_taken_off_inputs_and_outputs() -> None:
    seen = _flown(LAG)
    record = fid.Record.from_arrays(
        TIME_S,
        inputs={"u": STEP + 10.0},
        outputs={"p": seen["p"] + 4.0},
        units={"p": "rad/s"},
        trim={"u": 10.0, "p": 4.0},
    )
    result = fid.verify(LAG, record, state_bias=False, output_bias=False)
    assert_close(result.rms_error["p"], 0.0, atol=1e-12, why="trim is declared")
    assert_close(result.predicted["p"], record["p"], atol=1e-11, why="in the record's own values")


def test_an_unstable_model_needs_its_initial_state() -> None:
    # A pole at +0.8 1/s: over 12 s an initial state of 1e-3 grows by exp(9.6) = 15 000.
    growing = LinearSystem(
        [[0.8, 0.0], [1.0, 0.0]],
        [[2.0], [0.0]],
        np.eye(2),
        np.zeros((2, 1)),
        ("u",),
        ("q", "theta"),
    )
    record = fid.Record.from_arrays(TIME_S, inputs={"u": STEP})
    truth = fid.simulate(
        growing, record, initial_state=[1e-3, 0.1], units={"q": "rad/s", "theta": "rad"}
    )
    noise = np.random.default_rng(1).standard_normal((2, TIME_S.size)) * 1e-3
    seen = truth.replace({"q": truth["q"] + noise[0], "theta": truth["theta"] + noise[1]})
    at_trim = fid.verify(growing, seen, initial_state="trim", state_bias=False, output_bias=False)
    fitted = fid.verify(
        growing, seen, initial_state="estimate", state_bias=False, output_bias=False
    )
    assert at_trim.rms_error["q"] > 1.0
    assert_close(fitted.rms_error["q"], 1e-3, rtol=0.15, why="only the noise is left")
    assert_close(
        fitted.predictions[0].shifts.initial_state,
        [1e-3, 0.1],
        atol=3e-4,
        why="noise of 1e-3 over 600 samples",
    )
    assert "from an initial state solved for" in fitted.protocol


def test_several_records_are_shifted_apart_and_judged_together() -> None:
    seen = _flown(LAG)
    records = [seen.replace({"p": seen["p"] + shift}, name=f"r{shift}") for shift in (1.0, -2.0)]
    slow = LinearSystem([[-1.0]], [[1.5]], [[1.0]], [[0.0]], ("u",), ("p",))
    result = fid.verify(slow, records, state_bias=False)
    one = fid.verify(slow, records[:1], state_bias=False)
    shifts = [each.shifts.output_bias[0] for each in result.predictions]
    assert_close(shifts[0] - shifts[1], 3.0, rtol=1e-9, why="each record has its own")
    assert_close(result.theil["p"], one.theil["p"], rtol=1e-9, why="the same record twice")
    assert 0.02 < result.theil["p"] < 1.0


def test_hold_is_a_choice_that_shows() -> None:
    record = fid.Record.from_arrays(TIME_S, inputs={"u": np.sin(20 * TIME_S)})
    stepped = fid.simulate(LAG, record, hold="zero", units={"p": "rad/s"})
    options = {"state_bias": False, "output_bias": False}
    right = fid.verify(LAG, stepped, hold="zero", **options)  # type: ignore[arg-type]
    wrong = fid.verify(LAG, stepped, hold="first", **options)  # type: ignore[arg-type]
    assert_close(right.rms_error["p"], 0.0, atol=1e-12, why="the same hold")
    # Half a sample of delay at 20 rad/s: an error of 0.2 of the signal.
    expected = 20 * 0.01 * np.std(stepped["p"])
    assert_close(wrong.rms_error["p"], expected, rtol=0.1, why="first order in the delay")


def test_j_rms_counts_a_degree_as_a_foot_per_second() -> None:
    pair = LinearSystem([[-2.0]], [[3.0]], [[1.0], [1.0]], [[0.0], [0.0]], ("u",), ("p", "w"))
    record = fid.Record.from_arrays(TIME_S, inputs={"u": STEP})
    seen = fid.simulate(pair, record, units={"p": "deg/s", "w": "ft/s"})
    shifted = seen.replace({"p": seen["p"] + 3.0, "w": seen["w"] - 4.0})
    options = {"initial_state": "trim", "state_bias": False, "output_bias": False}
    result = fid.verify(pair, shifted, **options)  # type: ignore[arg-type]
    assert_close(result.j_rms, np.sqrt((9 + 16) / 2), rtol=1e-9, why="by definition")
    in_radians = fid.verify(pair, shifted.to_units(p="rad/s", w="m/s"), **options)  # type: ignore[arg-type]
    metric = LinearSystem(
        [[-2.0]], [[3.0]], [[np.pi / 180], [0.3048]], [[0.0], [0.0]], ("u",), ("p", "w")
    )
    in_si = fid.verify(metric, shifted.to_units(p="rad/s", w="m/s"), **options)  # type: ignore[arg-type]
    assert_close(in_si.j_rms, result.j_rms, rtol=1e-9, why="units are converted")
    assert in_radians.j_rms != result.j_rms


# Bounds computed independently from the standard's polynomials and delays.
@pytest.mark.parametrize(
    ("omega", "gain_upper", "gain_lower", "phase_upper", "phase_lower"),
    [(1.0, 2.74, -1.65, 30, -14), (2.0, 1.43, -1.33, 19, -15), (10.0, 3.49, -3.57, 24, -44)],
)
def test_mismatch_envelopes(
    omega: float, gain_upper: float, gain_lower: float, phase_upper: float, phase_lower: float
) -> None:
    bounds = validation.muad_envelopes([omega])
    assert_close(bounds.gain_upper_db, [gain_upper], atol=0.005, why="two decimals")
    assert_close(bounds.gain_lower_db, [gain_lower], atol=0.005, why="two decimals")
    assert_close(bounds.phase_upper_deg, [phase_upper], atol=0.5, why="whole degrees")
    assert_close(bounds.phase_lower_deg, [phase_lower], atol=0.5, why="whole degrees")


def test_a_known_ratio_is_judged_by_the_envelopes() -> None:
    omega = np.geomspace(0.3, 20.0, 60)
    flown = 3.0 / (2.0 + 1j * omega) * np.exp(-0.05j * omega)
    coherence = np.where(omega > 15.0, 0.3, 0.9)
    response = fid.FrequencyResponse.from_values(
        omega,
        (flown * 10 ** (1.0 / 20))[None, None],
        inputs=["u"],
        outputs=["p"],
        coherence=coherence[None, None],
    )
    near = validation.mismatch(LAG, response)
    assert_close(near.gain_db, np.full((1, 60), -1.0), atol=1e-9, why="one dB too small")
    assert_close(near.phase_deg, np.zeros((1, 60)), atol=1e-9, why="the same phase")
    assert near.inside_percent == (100.0,)
    late = LinearSystem([[-2.0]], [[3.0]], [[1.0]], [[0.0]], ("u",), ("p",), [0.20])
    far = validation.mismatch(late, response)
    expected = -np.degrees(0.15 * omega)
    assert_close(far.phase_deg[0], expected, atol=1e-9, why="0.15 s more delay")
    bounds = far.envelopes
    judged = coherence >= 0.6
    inside = np.mean((expected >= bounds.phase_lower_deg)[judged])
    assert_close(far.inside_percent[0], 100 * inside, rtol=1e-12, why="gain lies inside")
