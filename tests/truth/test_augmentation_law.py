"""The augmentation law as data: poles by SciPy alone, its limits and its wash-outs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

import flightid as fid
from flightid.control.laws.augmentation import AugmentationLaw, LawAxis, augmentation_law
from flightid.errors import OptionError, UnitError, UnknownNameError
from flightid.models.model import linear_system
from flightid.simulation.stepper import Stepper
from flightid.study.loop_blocks import law_controller, made_block
from flightid.study.reading import TableReader
from flightid.study.uses_settings import _loop
from tests.closeness import assert_close

STEP_S = 0.01
VEHICLE = fid.load_model("ah64_hover")
SYSTEM = linear_system(VEHICLE).state_space()
LAW = augmentation_law("dase")


def _series(*stages: tuple[list[float], list[float]]) -> tuple[np.ndarray, np.ndarray]:
    above, below = np.ones(1), np.ones(1)
    for over, under in stages:
        above, below = np.polymul(above, over), np.polymul(below, under)
    return above, below


def _law(axis: LawAxis, s: complex) -> dict[str, complex]:
    """What the axis adds to its stick by what it reads, written out by hand."""
    corner = axis.stick_shaping_rad_s
    late = np.exp(-axis.delay_s * s)
    quick = s / (s + axis.stick_high_pass_rad_s) * corner / (s + corner)
    rate = s / (s + axis.rate_washout_rad_s) * axis.gyro_rad_s / (s + axis.gyro_rad_s)
    found = {
        axis.input: late * axis.stick_gain * quick,
        axis.rate: -late * axis.rate_gain * rate,
    }
    if axis.attitude:
        found[axis.attitude] = -late * axis.attitude_gain * s / (s + axis.attitude_washout_rad_s)
    return found


def _return_difference(s: complex, gain: float = 1.0) -> complex:
    """det(I − G K) of the vehicle's own matrices, delays exact."""
    a, b, c, d, delays = SYSTEM
    plant = (c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d) @ np.diag(np.exp(-s * delays))
    law = np.zeros((len(VEHICLE.inputs), len(VEHICLE.outputs)), complex)
    for axis in LAW.axes:
        for name, value in _law(axis, s).items():
            if name in VEHICLE.outputs:
                row, column = VEHICLE.inputs.index(axis.input), VEHICLE.outputs.index(name)
                law[row, column] = gain * value
    return complex(np.linalg.det(np.eye(len(law)) - law @ plant))


def test_poles_with_the_law_are_those_of_its_equations() -> None:
    a = SYSTEM[0]
    bare = scipy.linalg.eigvals(a)
    assert bare.real.max() > 0.05
    closed = fid.close_loop(VEHICLE, list(map(made_block, LAW.tables())), draws=1)
    assert closed.is_stable
    poles = np.array([pole for pole in closed.loops.stability().poles if abs(pole) < 20.0])
    assert poles.real.max() < -0.02
    checked = 0
    for pole in poles:
        # The determinant vanishes at a pole, against its size on a small circle around it.
        around = pole + 1e-3 * np.exp(2j * np.pi * np.arange(8) / 8)
        size = np.mean([abs(_return_difference(each)) for each in around])
        at_open = min(abs(pole - corner) for corner in (*bare, -0.0, -1.0, -10.0, -60.0))
        if at_open < 2e-3 or size == 0.0:
            continue
        assert abs(_return_difference(pole)) < 1e-4 * size
        checked += 1
    assert checked >= 10


def test_unstable_poles_are_counted_around_the_right_half_plane() -> None:
    """Zeros of det(I − G K) less poles of G on a half circle: the argument principle, by NumPy."""
    radius, inner = 60.0, 1e-5
    up = 1j * np.geomspace(inner, radius, 2_000)
    far = radius * np.exp(1j * np.linspace(np.pi / 2, -np.pi / 2, 600))
    near = inner * np.exp(1j * np.linspace(-np.pi / 2, np.pi / 2, 200))
    path = np.concatenate([up, far, -up[::-1], near])
    unstable = int((scipy.linalg.eigvals(SYSTEM[0]).real > 1e-6).sum())
    for gain, left in ((0.0, unstable), (1.0, 0)):
        turns = np.unwrap(np.angle([_return_difference(s, gain) for s in path]))
        assert round((turns[0] - turns[-1]) / (2.0 * np.pi)) == left - unstable
    assert unstable == 2


@pytest.mark.parametrize("axis", LAW.axes, ids=lambda axis: axis.input)
def test_limits_and_washouts_of_an_axis(axis: LawAxis) -> None:
    """A tenth of the travel and no more; a stick, rate or angle that stays is forgotten."""
    assert axis.limit == pytest.approx(0.1 * axis.half_travel)
    alone = AugmentationLaw("one", (axis,))
    blocks = [made_block(table) for table in alone.tables()]
    open_law = fid.connect(
        [*blocks[:-2]],
        inputs=[n for n in (axis.input, axis.rate, axis.attitude) if n],
        outputs=[f"{axis.input}_law"],
    )
    omega = np.geomspace(1e-6, 50.0, 200)
    found = open_law.frequency_response(omega)[0]
    for row, name in zip(found, (axis.input, axis.rate, axis.attitude), strict=False):
        wanted = [_law(axis, 1j * w)[str(name)] * np.exp(1j * w * axis.delay_s) for w in omega]
        assert_close(row, np.array(wanted), atol=1e-12, why="the same filters by hand")
    assert np.abs(found[:, 0]).max() < 1e-4
    runner = law_controller({"axis": [_words(axis)]}, VEHICLE, STEP_S)
    hard = dict.fromkeys(VEHICLE.outputs, 0.0) | {axis.rate: 50.0}
    stick = dict.fromkeys(VEHICLE.inputs, 0.0)
    moved = [runner.step(stick, hard)[axis.input] for _ in range(200)]
    assert min(moved) == -axis.limit
    assert max(map(abs, moved)) == axis.limit


def _words(axis: LawAxis) -> dict[str, object]:
    return {name: value for name, value in axis.to_dict().items() if value is not None}


def test_the_command_and_the_study_take_the_law(tmp_path: Path) -> None:
    made = _loop(
        TableReader({"name": "a", "model": "b", "augmentation": "dase"}, "[[loop]]", "study")
    )
    assert list(made.block) == LAW.tables()
    for bad in (
        {"augmentation": "nobody"},
        {"augmentation": "dase", "gains": {"lon": {"q": 1.0}}},
        {},
    ):
        with pytest.raises((OptionError, ValueError), match=r"no such|beside|missing"):
            _loop(TableReader({"name": "a", "model": "b", **bad}, "[[loop]]", "study"))
    with pytest.raises(UnknownNameError, match="lon, lat, ped"):
        law_controller("dase", fid.load_model("quadrotor_roll_pitch"), STEP_S)
    with pytest.raises(UnitError, match="found 1; needed in"):
        law_controller("dase", fid.load_model("r50_hover"), STEP_S)
    (tmp_path / "law.toml").write_text('[[axis]]\ninput = "lon"\nrates = "q"\n')
    with pytest.raises(OptionError, match="keys do not fit"):
        augmentation_law(tmp_path / "law.toml")


def test_a_disturbed_helicopter_comes_to_rest_with_the_law_alone() -> None:
    grown = {}
    for name, law in (("off", None), ("on", law_controller("dase", VEHICLE, STEP_S))):
        stepper = Stepper(VEHICLE, STEP_S, controller=law)
        heard = [
            stepper.step({"lon": 0.3 if 1.0 < k * STEP_S < 1.5 else 0.0})["theta"]
            for k in range(6000)
        ]
        grown[name] = np.abs(heard[-1000:]).max() / np.abs(heard[:1000]).max()
    assert grown["off"] > 3.0
    assert grown["on"] < 0.3
