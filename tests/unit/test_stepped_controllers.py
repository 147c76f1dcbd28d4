"""Controllers one frame at a time: the same numbers as their recursions and as loops in time."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.control.autopilots import AxisLoop, axis_loop
from flightid.control.stepped.block_controller import BlockController
from flightid.control.stepped.gain_controller import gain_controller, pid_controller
from flightid.errors import OptionError, UnitError, UnknownNameError
from flightid.simulation.stepper import Stepper
from tests.closeness import assert_close

STEP_S = 0.01
ROLL = fid.LinearSystem(
    [[-3.0, 0.0], [1.0, 0.0]], [[20.0], [0.0]], np.eye(2), np.zeros((2, 1)), ("tau_phi",),
    ("p", "phi"), units={"p": "rad/s", "phi": "rad"},
)  # fmt: skip
SIGNAL = np.cumsum(np.random.default_rng(3).standard_normal(300)) * 0.1
LOOP = axis_loop("arducopter", "roll", loop_rate_hz=400.0)


@pytest.mark.parametrize(
    "loop",
    [LOOP, LOOP.with_gains(ATC_RAT_RLL_SMAX=5.0), axis_loop("px4_multicopter", "yaw",
     loop_rate_hz=250.0), axis_loop("arduplane", "pitch", loop_rate_hz=50.0)],
    ids=["arducopter", "slew limit", "px4", "arduplane"],
)  # fmt: skip
def test_one_loop_at_a_time_is_the_recursion(loop: AxisLoop) -> None:
    wanted, step = np.sign(SIGNAL), loop.runner()
    found = [step(r, y) for r, y in zip(wanted, SIGNAL, strict=True)]
    whole = loop.run(wanted, SIGNAL).output
    assert np.ptp(whole) > 0.01
    assert_close(np.array(found), whole, rtol=0.0, atol=2e-6 * np.ptp(whole),
                 why="the firmware's single precision")  # fmt: skip


def test_blocks_do_what_loops_in_time_do() -> None:
    """A shaped stick behind a limit: filters, sums and limits on inputs that are steps."""
    law = [
        fid.loops.high_pass("tau_phi", "shaped", 2.0),
        fid.loops.sum_of("asked", "shaped", "-trim"),
        fid.loops.limiter("asked", "limited", 0.3, -0.2),
        fid.loops.gain(["limited", "p"], "tau_phi", [[0.5, -0.1]]),
    ]
    stepped = BlockController(law, ROLL, STEP_S)
    assert stepped.commands == ("trim",)
    found = [
        stepped.step({"tau_phi": u, "trim": 0.05}, {"p": 0.2, "phi": 0.0})["tau_phi"]
        for u in SIGNAL
    ]
    inputs = {"stick": SIGNAL, "trim": 0.05 + 0 * SIGNAL, "p": 0.2 + 0 * SIGNAL}
    renamed = [fid.loops.high_pass("stick", "shaped", 2.0), *law[1:]]
    record = fid.Record.from_arrays(np.arange(300) * STEP_S, inputs=inputs, hold="zero")
    whole = fid.connect(renamed, inputs=list(inputs), outputs=["tau_phi"]).simulate(record)
    assert np.ptp(whole["limited" if "limited" in whole else "tau_phi"]) == pytest.approx(0.25)
    assert_close(np.array(found), whole["tau_phi"], rtol=0.0, atol=1e-12, why="both are exact")


def test_rates_and_holds_keep_to_their_frames() -> None:
    law = [
        fid.loops.sample_and_hold("p", "held", 3 * STEP_S, STEP_S),
        fid.loops.rate_limiter("held", "tau_phi", 10.0),
    ]
    stepped = BlockController(law, ROLL, STEP_S)
    found = [stepped.step({}, {"p": float(k), "phi": 0.0})["tau_phi"] for k in range(8)]
    assert_close(
        np.array(found), [0, 0, 0, 0, 0.1, 0.2, 0.3, 0.4], rtol=0.0, atol=1e-12,
        why="held 0 for three frames from the second, then 0.1 a frame towards 3",
    )  # fmt: skip
    with pytest.raises(OptionError, match="between the frames"):
        BlockController(law, ROLL, 0.007)
    circle = [fid.loops.gain("b", "a", 1.0), fid.loops.gain(["a", "p"], "b", [[1.0, 1.0]])]
    with pytest.raises(OptionError, match="go in a circle"):
        BlockController([*circle, fid.loops.gain("b", "tau_phi", 1.0)], ROLL, STEP_S)


def test_gains_hold_the_commanded_angle() -> None:
    law = gain_controller({"ATC_RAT_RLL_P": 0.2}, ROLL, 400.0)
    assert law.commands == ("phi_command",)
    assert law.loops["tau_phi"].gains["ATC_RAT_RLL_P"] == 0.2
    stepper = Stepper(ROLL, 1 / 400, controller=law)
    assert stepper.inputs == ("tau_phi", "phi_command")
    for _ in range(4000):
        outputs = stepper.step({"phi_command": 0.2})
    assert_close(outputs["phi"], 0.2, rtol=1e-3, why="ten seconds, and an integrator")
    with pytest.raises(OptionError, match="no autopilot"):
        gain_controller({"INS_GYRO_FILTER": 20.0}, ROLL, 400.0)
    with pytest.raises(UnknownNameError, match="channels of the pitch gains"):
        gain_controller({"ATC_RAT_PIT_P": 0.2}, ROLL, 400.0)
    degrees = fid.LinearSystem([[-3.0]], [[20.0]], [[1.0]], [[0.0]], ("tau_phi",), ("p",),
                               units={"p": "deg/s"})  # fmt: skip
    with pytest.raises(UnitError, match="deg"):
        gain_controller({"ATC_RAT_RLL_P": 0.2}, degrees, 400.0)


def test_a_pid_as_tune_writes_it_holds_its_output() -> None:
    lag = fid.LinearSystem([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    table = {"output": "y", "Kp": 2.0, "Ki": 3.0, "Tt": 0.0, "sample_time_s": STEP_S}
    stepper = Stepper(lag, STEP_S, controller=pid_controller([table], lag, 100.0))
    for _ in range(1500):
        outputs = stepper.step({"y_command": 0.7})
    assert_close(outputs["y"], 0.7, rtol=1e-6, why="an integrator leaves no error")
    for wrong, error, match in (
        ([table, table], OptionError, "do not go together"),
        ([table | {"output": "z"}], UnknownNameError, "no output"),
        ([{"output": "y"}], OptionError, "has no gains"),
        ([table | {"sample_time_s": 0.02}], OptionError, "rate of its own"),
    ):
        with pytest.raises(error, match=match):
            pid_controller(wrong, lag, 100.0)


def test_the_command_flies_gains_and_blocks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gains, law = tmp_path / "roll.param", tmp_path / "law.toml"
    gains.write_text("ATC_RAT_RLL_P,0.05\n")
    law.write_text('[[block]]\nkind = "gain"\ninputs = "p"\noutputs = "tau_phi"\nvalue = -0.1\n')
    words = ["fly", "rate_motor_lag", "--axis", "roll", "--duration", "0.1", "--json"]
    assert run([*words, "--gains", str(gains), "--rate", "400"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["frames"] == 40
    assert "P 0.05" in said.err
    assert "p_command" in said.err
    assert run([*words, "--blocks", str(law)]) == 0
    capsys.readouterr()
    assert run([*words, "--blocks", str(law), "--gains", str(gains)]) == 2
    assert "give one of them" in capsys.readouterr().err
    law.write_text('[[block]]\nkind = "gian"\n')
    assert run([*words, "--blocks", str(law)]) == 2
    assert "law.toml, [[block]]: there is no such kind" in capsys.readouterr().err
