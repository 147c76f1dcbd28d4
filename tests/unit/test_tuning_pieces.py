"""Grids, ranges and words that a search for gains is made of, each by its formula."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid.control.tuning import evidence
from flightid.control.tuning.controller_options import ControllerOptions
from flightid.control.tuning.filter_choice import AxisFilters, FilterChoice, _cutoffs
from flightid.control.tuning.gain_search import CHUNK, _chunks, _Space, _starts
from flightid.control.tuning.gain_steps import TunedGain, reached
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.responses import BELOW_NYQUIST, LIKE_ZERO, _pulses
from flightid.control.tuning.sampled_plants import SampledPlants, loop_grid
from flightid.control.tuning.standing_error import judge_standing, slow_gain, standing_errors
from flightid.control.tuning.tune_controller import _gains_given, _loop, _scaled, _sign, _turn
from flightid.control.tuning.tune_pid import _require_right_way, noise_density
from flightid.control.tuning.tuned_filters import TunedFilters
from flightid.errors import ModelError, OptionError
from flightid.models import LinearSystem
from tests.closeness import assert_close

LOW = {"P": 0.01, "I": 0.02, "D": 0.0, "A": 2.0}
HIGH = {"P": 1.0, "I": 3.0, "D": 0.05, "A": 12.0}


def _space(kinds: str, slower: float = 1.0, ratio: float = math.inf) -> _Space:
    low, high = (np.array([ends[kind] for kind in kinds]) for ends in (LOW, HIGH))
    return _Space(tuple(kinds), low, high, slower, ratio)


@pytest.mark.parametrize("kinds", ["P", "PI", "PD", "PID", "PIDA", "IPD"])
def test_points_and_gains_are_each_others_inverse(kinds: str) -> None:
    for slower in (1.0, 4.0):
        space = _space(kinds, slower)
        gains = np.array([{"P": 0.2, "I": 0.5, "D": 0.004, "A": 5.0}[kind] for kind in kinds])
        point = space.to_point(gains)
        wanted = {
            "P": math.log(0.2), "I": math.log(2.5), "D": 0.02 / (0.1 * slower), "A": math.log(5.0)
        }  # fmt: skip
        assert_close(point, [wanted[kind] for kind in kinds], rtol=1e-12, why="logarithms")
        assert_close(space.to_gains(point[None])[0], gains, rtol=1e-12, why="inverse")
        low, high = space.bounds()
        ends = {
            "P": np.log([0.01, 1.0]), "A": np.log([2.0, 12.0]), "D": [0.0, 5.0],
            "I": np.log(np.array([1e-3, 1e2]) / slower),
        }  # fmt: skip
        assert_close(np.array([low, high]).T, [ends[kind] for kind in kinds], atol=1e-12, why="log")
        far = space.to_gains(np.array([low - 9.0, high + 9.0]))
        assert np.all(far >= space.low)
        assert np.all(far <= space.high)


def test_the_ratio_of_i_to_p_is_bounded_as_the_autopilot_bounds_it() -> None:
    for ratio, high in ((2.5, 2.5), (1e-6, 2e-3), (1e6, 1e2)):
        assert_close(_space("PI", 1.0, ratio).bounds()[1][1], math.log(high), rtol=1e-9, why="clip")
    space = _space("PI", ratio=0.6)
    grid = space.grid()
    assert np.max(grid[:, 1] / grid[:, 0]) == pytest.approx(0.6)
    assert _space("PI").to_point(np.array([0.5, 0.0]))[1] == pytest.approx(math.log(1e-9 / 0.5))


def test_a_first_grid_spans_ranges_and_times_of_the_loop() -> None:
    wide = {"low": np.array([1e-9, 0.0, 0.0, 1e-9]), "high": np.array([1e9, 1e12, 1e12, 1e9])}
    for slower in (1.0, 3.0):
        space = _Space(("P", "I", "D", "A"), wide["low"], wide["high"], slower, math.inf)
        grid = space.grid()
        assert grid.shape == (14 * 5 * 5 * 3, 4)
        times_i = np.unique(np.round(grid[:, 0] / grid[:, 1] / slower, 9))
        times_d = np.unique(np.round(grid[:, 2] / grid[:, 0] / slower, 9))
        assert_close(times_i, np.geomspace(0.05, 5.0, 5), rtol=1e-6, why="I, s")
        assert_close(times_d, [0.0, *np.geomspace(0.003, 0.3, 4)], rtol=1e-6, why="D, s")
        assert_close(np.unique(grid[:, 0]), np.geomspace(1e-9, 1e9, 14), rtol=1e-9, why="P")
    assert _space("P").grid()[:, 0].tolist() == np.geomspace(0.01, 1.0, 14).tolist()
    # Ranges that fit no such ratio still hold their own corners.
    narrow = _Space(("P", "I"), np.array([1.0, 90.0]), np.array([1.0, 95.0]), 1.0, math.inf)
    assert np.all(narrow.grid() == [[1.0, 90.0]])


def test_starts_are_the_best_candidates_of_different_shapes() -> None:
    coarse = np.array([[1.0, 1.0], [2.0, 2.0], [1.0, 3.0], [1.0, 4.0], [1.0, 5.0]])
    slack = np.array([0.1, 0.2, -0.1, 0.0, -6.0])
    worth = np.array([5.0, 6.0, 9.0, 1.0, 9.0])
    for count, target, chosen in (
        (2, False, [1, 3]), (3, False, [1, 3, 2]), (9, False, [1, 3, 2, 4]), (2, True, [1, 3]),
    ):  # fmt: skip
        found = _starts(coarse, slack, worth, target, count)
        assert [each.tolist() for each in found] == [coarse[k].tolist() for k in chosen]
    parts = list(_chunks(np.arange(2.0 * CHUNK + 1)))
    assert [len(each) for each in parts] == [CHUNK, CHUNK, 1]
    assert np.concatenate(parts).tolist() == list(range(2 * CHUNK + 1))


def test_gains_stand_at_an_end_of_their_range_within_a_thousandth() -> None:
    for new, at in ((0.5, True), (0.4995, True), (0.4994, False), (0.0105, True), (0.0106, False)):
        assert TunedGain("P", "", 0.1, new, 0.01, 0.5).at_limit is at, new
    assert TunedGain("P", "", 0.0, 0.1, 0.01, 0.5).ratio is None
    assert TunedGain("P", "", None, 0.1, 0.01, 0.5).ratio is None
    assert TunedGain("P", "", 0.2, 0.1, 0.01, 0.5).ratio == 0.5
    assert reached(3.0, 12.0, 3.0) == (3.0, 12.0)
    assert reached(0.2, 1.0, 1.0, "s") == (0.2, 1.0)
    assert reached(0.2, 1.0, 0.1, "s") == (0.1, 1.0)


def test_cut_offs_are_whole_hertz_within_limit_range_and_spectrum() -> None:
    def tried(step: float, known: float, low: float = 0.0, high: float = 1e3) -> list[float]:
        loop: Any = SimpleNamespace(
            gains={"f": 40.0}, ranges={"f": SimpleNamespace(low=low, high=high)}
        )
        return _cutoffs(loop, "f", step, known)

    wide = tried(2.0, 1e4)
    assert (wide[0], wide[-1], len(wide)) == (20.0, 80.0, 9)
    assert wide == sorted({40.0, *np.round(np.geomspace(20.0, 80.0, 9)).tolist()})
    assert tried(100.0, 1e4)[0] == 5.0
    assert tried(2.0, 180.0)[-1] == 60.0
    assert tried(2.0, 90.0)[-1] == 40.0
    assert (tried(2.0, 1e4, 30.0, 50.0)[0], tried(2.0, 1e4, 30.0, 50.0)[-1]) == (30.0, 50.0)
    assert tried(1.0, 1e4) == [40.0]
    loop: Any = SimpleNamespace(gains={"f": 40.0}, ranges={})
    assert _cutoffs(loop, "f", 2.0, 1e4) == [40.0]


def _system(
    a: list[list[float]], b: list[float], c: list[float], d: float = 0.0, step: float | None = None
) -> LinearSystem:
    states = tuple(f"x{k}" for k in range(len(a)))
    return LinearSystem(
        np.array(a), np.array(b)[:, None], np.array([c]), np.array([[d]]), ("u",), ("y",),
        states=states, sample_time_s=step,
    )  # fmt: skip


def test_a_grid_of_a_loop_leads_from_below_all_dynamics_to_half_the_rate() -> None:
    grid = loop_grid(0.01, 50)
    assert grid.size == 90
    top = (1.0 - 1e-4) * math.pi / 0.01
    assert_close(grid[[0, 40, -1]], [1e-5, 0.05, top], rtol=1e-12, why="the knee")
    assert_close(np.diff(np.log(grid[40:])), math.log(top / 0.05) / 49, rtol=1e-9, why="even")
    slow = loop_grid(1.0, 50)
    knee = (1.0 - 1e-4) * math.pi / 600.0
    assert_close(slow[[0, 40]], [1e-5 * knee / 0.05, knee], rtol=1e-12, why="600 below the top")
    marked = loop_grid(0.01, 50, np.array([3.3, 0.0, 1e9, 7.7, grid[60]]))
    assert set(marked) == {*grid, 3.3, 7.7}
    assert np.all(np.diff(marked) > 0.0)
    many = loop_grid(0.01, 50, np.linspace(1.0, 200.0, 999))
    assert many.size == 90 + 25
    assert {1.0, 200.0} <= set(many)
    near = loop_grid(0.01, 50, grid[[60]] * (1.0 + 1e-8))
    assert near.size == 90


def test_resonances_are_drawn_across_light_modes_alone() -> None:
    def plant(damping: float) -> LinearSystem:
        root = 0.1 * 9.0 * complex(-damping, math.sqrt(1.0 - damping**2))
        real, imag = np.exp(root).real, np.exp(root).imag
        return _system([[real, imag], [-imag, real]], [0.0, 1.0], [1.0, 0.0], step=0.1)

    none = np.zeros((1, 1), np.int64), np.zeros((1, 1)), np.zeros(1, np.int64)
    for damping, width in ((0.05, 0.05), (0.0999, 0.0999), (1e-4, 1e-3), (0.101, None)):
        found = np.sort(SampledPlants((plant(damping),), *none).resonances())
        if width is None:
            assert found.size == 0
        else:
            across = np.array([-6.0, -3.0, -1.5, -0.75, 0.0, 0.75, 1.5, 3.0, 6.0])
            assert_close(found, 9.0 * (1.0 + width * across), rtol=1e-6, why="a logarithm")


def test_what_a_loop_without_an_integrator_leaves_of_a_step() -> None:
    lag, twice = _system([[-2.0]], [3.0], [1.0]), _system([[-2.0]], [6.0], [1.0])
    motor = _system([[0.0, 1.0], [0.0, -2.0]], [0.0, 3.0], [1.0, 0.0])
    falling = _system([[0.0, 1.0], [4.0, 0.0]], [0.0, 3.0], [1.0, 0.0])
    for system, gain, integrators, unstable in (
        (lag, 1.5, 0, 0), (motor, 1.5, 1, 0), (falling, -0.75, 0, 1),
        (_system([[math.exp(-0.2)]], [1.0 - math.exp(-0.2)], [1.5], step=0.1), 1.5, 0, 0),
        (_system([[1.0]], [0.1], [1.5], step=0.1), 1.5, 1, 0),
        (_system([[0.0]], [1.0], [1.5], step=0.1), 1.5, 0, 0),
    ):  # fmt: skip
        found = slow_gain(system, "y", "u")
        assert_close(found[0], gain, rtol=1e-4, why="a millionth above rest")
        assert found[1:] == (integrators, unstable)
        # Feedback has to answer each real pole on the right by turning round.
        assert _sign(system, "y", "u") == math.copysign(1.0, gain) * (-1) ** unstable
    away = _system([[1.0, 0.0], [1.0, 2.0]], [1.0, 0.0], [0.0, 1.0])
    assert slow_gain(away, "y", "u")[1:] == (0, 2)
    assert _sign(away, "y", "u") == 1.0
    loop: Any = SimpleNamespace(values={"p": 2.0, "b": 0.8}, direct=False)
    errors = standing_errors(loop, [lag, twice, motor], "y", "u")
    assert_close(errors, [1.0 - 0.8 * 0.75, 1.0 - 0.8 * 6.0 / 7.0, 0.2], rtol=1e-5, why="formula")
    loop.direct = True
    assert_close(standing_errors(loop, [lag], "y", "u"), [1.0 - 0.8 * 1.5], rtol=1e-5, why="sign")
    loop.values, loop.direct = {"p": 2.0}, False
    assert_close(standing_errors(loop, [lag], "y", "u"), [0.25], rtol=1e-5, why="b is one")
    (found,) = judge_standing(loop, lag, [twice], "y", "u")
    assert found.message.startswith(
        "a step of the set-point ends 25 % short of it, and stays there (worst plant 25 %): the"
    )
    loop.values = {"p": 6.1}
    (found,) = judge_standing(loop, lag, [], "y", "u")
    assert (found.code, found.light, found.action) == ("standing-error", "green", "")
    assert found.message == "a step of the set-point ends 10 % short of it, and stays there"
    loop.values = {"p": 2.0, "i": 0.1}
    assert standing_errors(loop, [lag, twice], "y", "u").tolist() == [0.0, 0.0]
    assert judge_standing(loop, lag, [], "y", "u") == []


def test_corners_are_those_of_what_is_known_and_makes_sense(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def steps(scale: float) -> Any:
        yield scale, -scale
        yield "late", 2.0 * scale
        raise ModelError("no further", found="", needed="")

    def linear(each: Any, step: float) -> Any:
        if each == "late":
            raise ModelError("a negative delay", found=-1, needed="≥ 0")
        return each, step

    monkeypatch.setattr(evidence, "_linear", linear)
    for known, corners in ((True, [1.0, -1.0, 2.0]), (False, [])):
        uncertain: Any = SimpleNamespace(known=known, steps=steps)
        found = [*evidence._corners(uncertain, 0.01)]
        assert found == [(evidence.CORNER * each, 0.01) for each in corners]


def test_pulses_are_asked_from_nearly_rest_to_nearly_half_the_sampling() -> None:
    asked: list[Any] = []

    def axis(omega: Any, _: Any) -> Any:
        asked.append(omega)
        raise ModelError("enough", found="", needed="")

    plants = SimpleNamespace(sample_time_s=0.01)
    closed: Any = SimpleNamespace(place=0, gyro="raw", plants=plants, axis=axis)
    for count in (8, 64):
        with pytest.raises(ModelError):
            next(_pulses(closed, [], count))
        wanted = np.linspace(0.0, np.pi / 0.01, count // 2 + 1)
        wanted[0], wanted[-1] = LIKE_ZERO * wanted[1], BELOW_NYQUIST * wanted[-1]
        assert_close(asked.pop(), wanted, rtol=1e-12, why="rounding")


def test_a_rate_that_answers_the_wrong_way_after_015_s_is_refused() -> None:
    def plants(step: float) -> Any:
        return SimpleNamespace(sample_time_s=step)

    late = _system([[0.9]], [-0.1], [1.0], 2.0 * (1.0 - 0.9**6) / 2.0 + 1e-6, step=0.025)
    _require_right_way(late, plants(0.025), ["y"])
    for d in (np.asarray(late.d)[0, 0] - 2e-6, -1.0):
        wrong = _system([[0.9]], [-0.1], [1.0], float(d), step=0.025)
        with pytest.raises(ModelError, match="y answers a positive command with a negative rate"):
            _require_right_way(wrong, plants(0.025), ["y"])
    with pytest.raises(ModelError):
        _require_right_way(_system([[0.9]], [-0.1], [1.0], 0.05, step=9.0), plants(9.0), ["y"])


def test_ranges_of_a_controller_scale_with_the_plants_time_and_gain() -> None:
    loop = _loop(ControllerOptions(controller="pid"), "y", 50.0, True, False)
    made = _scaled(loop, 5.0, 3.0 - 4.0j)
    assert made.time_scale == 4.0
    ends = {name: (each.low, each.high) for name, each in made.ranges.items()}
    assert_close(ends["Kp"], (1e-3 / 5.0, 2.0), rtol=1e-12, why="over the plant's gain")
    assert_close(ends["Ki"], (1e-6 / 5.0 / 4.0, 25.0), rtol=1e-12, why="over its time")
    assert_close(ends["Kd"], (0.0, 4.0), rtol=1e-12, why="times its time")
    assert made.values["filter_s"] == 0.02
    assert _gains_given({"Kp": 1.0}, loop) == {"Kp": 1.0, "Ki": 0.0, "Kd": 0.0}
    for wrong in ({"Kp": -1.0}, {"Kq": 1.0}, {"Kp": 0.0}, {"Kp": math.inf}):
        with pytest.raises(OptionError, match="holds no gains of its controller"):
            _gains_given(wrong, loop)


def _axis(**told: Any) -> AxisFilters:
    known = {
        "axis": "roll", "crossover_rad_s": 20.0 * math.pi, "phase_flown_deg": -40.0,
        "phase_new_deg": -32.5, "noise_flown": 0.0123, "noise_new": 0.0234, "noise_limit": 0.02,
        "unit": "1", "phase_shared_deg": -38.0, "noise_shared": 0.013,
    }  # fmt: skip
    return AxisFilters(**known | told)


def test_filters_are_told_by_phase_and_noise() -> None:
    change: Any = SimpleNamespace(name="FLT", value=40.0, old=20.0)
    made = TunedFilters((change,), (_axis(),), ("roll",), "", {})
    assert made.words == (
        "Filters, roll: 7.5 deg saved at the crossover, output noise 0.012 as flown, 0.023 with "
        "the filters",
    )
    assert made.table().rows[0][1:3] == (10.0, 7.5)
    (finding,) = made.findings()
    assert finding.message == (
        "noise of the gyroscope moves the roll output by 0.023, rms (0.012 as flown); 0.02 is fine"
    )
    lost = _axis(phase_new_deg=-42.0, noise_tuned=0.0201)
    made = TunedFilters((change,), (lost,), ("roll",), "", {"yaw": -0.99, "pitch": -1.01})
    assert made.words[0].startswith("Filters, roll: 2 deg lost at the crossover")
    assert made.words[0].endswith("0.023 with the filters, 0.02 with the gains too")
    assert made.unjudged(["yaw", "pitch"]) == {"pitch": 1.01}
    assert [each.code for each in made.findings()] == ["filters-unjudged"]
    assert len(made.words) == 1
    freed = TunedFilters((change,), (_axis(noise_tuned=0.0247),), ("roll",), "", {})
    assert freed.words[1].endswith(
        "Output noise: roll 0.012 as flown, 0.025 with the new gains (0.02 is fine)."
    )
    flown = TunedFilters((), (), (), "no spectrum", {})
    assert flown.words == ("Filters as flown: no spectrum.",)
    assert TunedFilters((), (), (), "", {}).words[0].startswith("Filters as flown: no other is")


def test_changes_of_filters_are_told_with_what_flew() -> None:
    old, new = (
        SimpleNamespace(name=n, value=v, old=o) for n, v, o in (("A", 40.0, 20.0), ("B", 5.5, None))
    )
    loops: Any = {"roll": SimpleNamespace(gains={"A": 1}), "pitch": SimpleNamespace(gains={"B": 1})}
    made = FilterChoice((old, new), (), True, loops)  # type: ignore[arg-type]
    assert made.words == "A 20 to 40, B 5.5"
    assert made.changes_of("roll") == (old,)
    assert made.values == {"A": 40.0, "B": 5.5}
    assert repr(FilterChoice((), (), True)) == "FilterChoice(as flown)"


def test_white_noise_of_a_gyro_is_a_density_up_to_half_the_rate() -> None:
    assert noise_density(None, 0.0025) is None
    found = noise_density(0.02, 0.0025)
    assert found is not None
    frequency, density = found
    variance = np.trapezoid(density, frequency) / (2.0 * math.pi)
    assert_close(variance, 0.02**2, rtol=1e-9, why="per hertz")
    assert_close(frequency[[0, -1]], [0.0, math.pi / 0.0025], rtol=1e-12, why="half the rate")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_crossover_is_looked_for_where_the_phase_leaves_45_deg(sign: float) -> None:
    """Of k exp(-L s)/s at pi/4/L, whichever way it answers."""
    plant = LinearSystem(
        np.zeros((1, 1)), np.full((1, 1), 3.0 * sign), np.eye(1), np.zeros((1, 1)), ("u",), ("y",),
        delays_s=[0.05],
    )  # fmt: skip
    need = TuningRequirements(band_factor=3.0)
    for band, rate, wanted in (
        (None, 100.0, math.pi / 4.0 / 0.05), ((0.1, 60.0), None, math.pi / 4.0 / 0.05),
        ((0.1, 30.0), 100.0, 10.0), ((0.1, 300.0), 9.0, 3.0 * math.pi),
    ):  # fmt: skip
        evidence: Any = SimpleNamespace(estimate=plant, band_rad_s=band)
        assert_close(_turn(evidence, "y", "u", rate, need), wanted, rtol=5e-3, why="4,000 points")
    lag = _system([[-2.0]], [3.0 * sign], [1.0])
    evidence = SimpleNamespace(estimate=lag, band_rad_s=None)
    with pytest.raises(ModelError, match="no lag that would bound its gains"):
        _turn(evidence, "y", "u", None, need)
    evidence = SimpleNamespace(estimate=lag, band_rad_s=(0.1, 60.0))
    assert _turn(evidence, "y", "u", None, need) == 20.0
