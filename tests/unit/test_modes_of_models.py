"""Modes: numbers, intervals, words, kinds of source, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import flightid as fid
from flightid import errors
from flightid.dynamics.modes.modes import UNFITTED
from flightid.dynamics.modes.participation import eigenpairs
from flightid.models.sampled.discrete_modes import NO_COUNTERPART
from flightid.study.estimate_tables import modes_cells, short_modes_table
from flightid.uncertainty.quantiles import half_width
from flightid.uncertainty.roots import UNSIGNED
from tests.closeness import assert_close


@pytest.fixture(scope="module")
def fit() -> fid.Fit:
    model = fid.load_model("r50_hover").with_responses("p/lat", "q/lon", "p/lon", "q/lat")
    names = {p.name for p in model.parameters.free} - {"Lb", "Ma", "tau_s", "Bd", "Ac"}
    fixed = model.with_fixed(**{name: model.parameters[name].value for name in names})
    omega = np.geomspace(0.5, 25.0, 40)
    data = fid.FrequencyResponse.from_values(
        omega,
        model.frequency_response(omega),
        inputs=model.inputs,
        outputs=model.outputs,
        units=model.units,
        random_error=np.full((len(model.outputs), 4, 40), 0.02),
    )
    return fid.identify(fixed, data, n_omega=40)


def test_one_of_each_pair_slowest_first(fit: fid.Fit) -> None:
    found = fid.modes(fit)
    sizes = list(found.natural_frequency_rad_s)
    assert sizes == sorted(sizes)
    assert all(mode.root.imag >= 0.0 for mode in found)
    assert len(found.eigenvalues) == 13
    assert_close(
        np.sort_complex(found.eigenvalues),
        np.sort_complex(fit.model.eigenvalues()),
        rtol=1e-9,
        why="the same matrix, balanced first",
    )
    assert len(found.table().rows) == len(found) == len(found.damping)
    assert found.summary().title == "Modes of Yamaha R-50, hover"
    assert "phugoid" in found._repr_html_()
    assert json.loads(json.dumps(found.to_dict()))["schema"] == "flightid.modes/1"


def test_errors_are_those_of_the_parameters_carried_through(fit: fid.Fit) -> None:
    """Against differences of eigenvalues and participations themselves along each parameter."""
    roll = fid.modes(fit).mode("roll/lateral")
    steps = []
    for name in fit.names:
        step = 1e-5 * fit.parameters[name].value
        ends = []
        for sign in (1.0, -1.0):
            changed = fit.model.with_values({name: fit.parameters[name].value + sign * step})
            there = fid.modes(changed).mode("roll/lateral")
            value = there.root
            sizes = {p.state: p.size.value for p in there.participations}
            ends.append(
                [
                    *(value.real, value.imag, abs(value), -value.real / abs(value)),
                    *(there.share(s) for s in fit.model.states),
                    *(sizes[s] for s in fit.model.states),
                ]
            )
        steps.append((np.array(ends[0]) - np.array(ends[1])) / (2.0 * step))
    slopes = np.array(steps)
    assert fit.covariance is not None
    expected = 1.959964 * np.sqrt(np.einsum("ia,ij,ja->a", slopes, fit.covariance, slopes))
    numbers = (roll.real, roll.imaginary, roll.natural_frequency, roll.damping_ratio)
    by_state = {p.state: p for p in roll.participations}
    parts = [by_state[state].share for state in fit.model.states]
    sizes_now = [by_state[state].size for state in fit.model.states]
    halves = [
        0.0 if q.interval95 is None else (q.interval95[1] - q.interval95[0]) / 2.0
        for q in (*numbers, *parts, *sizes_now)
    ]
    assert_close(halves, expected, rtol=2e-5, atol=1e-7, why="central differences")
    assert roll.covariance is not None
    assert_close(roll.covariance[0, 0], (expected[0] / 1.959964) ** 2, rtol=1e-4, why="differences")


def test_times_have_the_interval_of_the_rate_turned_over(fit: fid.Fit) -> None:
    roll = fid.modes(fit).mode("roll/lateral")
    low, high = roll.real.interval95 or (0.0, 0.0)
    tau = roll.time_constant
    assert tau.interval95 is not None
    assert_close(tau.value, -1.0 / roll.root.real, rtol=1e-12, why="definition")
    assert_close(tau.interval95, (-1.0 / low, -1.0 / high), rtol=1e-12, why="monotonic")
    half = roll.time_to_half
    assert_close(half.value, np.log(2.0) * (tau.value or 0.0), rtol=1e-12, why="definition")
    assert roll.time_to_double.value is None
    assert roll.time_to_double.reason == "no growth"
    assert_close(roll.period.value, 2 * np.pi / roll.root.imag, rtol=1e-12, why="definition")


def test_no_intervals_without_covariance(fit: fid.Fit) -> None:
    bare = fid.modes(replace(fit, covariance=None))
    assert bare.reason == "the fit knows no errors of its data"
    assert all(q.interval95 is None and q.reason for m in bare for q in m.quantities)
    assert all(mode.covariance is None for mode in bare)


def test_what_was_not_fitted_has_no_interval(fit: fid.Fit) -> None:
    """Heave and the gyro's loop do not hold any of the five free parameters."""
    heave = fid.modes(fit).mode("heave")
    assert heave.real.interval95 is None
    assert heave.real.reason == UNFITTED


def test_coinciding_eigenvalues_have_no_interval_and_say_why() -> None:
    a = np.array([[-2.0, 1.0], [0.0, -2.0]])
    (first, second) = eigenpairs(a, np.ones((1, 2, 2)))
    for pair in (first, second):
        assert pair.value_moves is None
        assert "coincides with the eigenvalue -2" in pair.reason
        assert pair.factors is None
    near = np.array([[-2.0, 1.0], [1e-4, -2.0]])
    for pair in eigenpairs(near, 0.05 * np.ones((1, 2, 2))):
        assert pair.value_moves is None
        assert "move it out of proportion, by" in pair.reason


def test_crossing_without_coupling_keeps_its_intervals() -> None:
    """Roll and heave may have nearly the same time constant and nothing to do with each other."""
    a = np.diag([-2.0, -2.001])
    for pair in eigenpairs(a, 0.05 * np.array([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])])):
        assert pair.value_moves is not None
        assert_close(np.abs(pair.value_moves).max(), 0.05, rtol=1e-6, why="diagonal")


def test_shares_do_not_depend_on_units() -> None:
    model = fid.load_model("r50_hover").linear_system()
    a = np.asarray(model.a)
    scale = np.geomspace(1e-3, 1e3, len(a))
    first, second = (list(eigenpairs(each)) for each in (a, a * scale / scale[:, None]))
    for one, other in zip(first, second, strict=True):
        assert_close(one.shares, other.shares, rtol=1e-6, atol=1e-8, why="scaled states")
        assert one.factors is not None
        assert_close(np.sum(one.factors), 1.0, rtol=1e-12, why="their sum is one")


def test_sampled_models_are_turned_to_continuous_time() -> None:
    continuous = fid.load_model("fixed_wing_longitudinal").linear_system()
    sampled = fid.LinearSystem(
        *continuous.sampled(0.02).state_space()[:4],
        continuous.inputs,
        continuous.outputs,
        sample_time_s=0.02,
    )
    kept = [m for m in fid.modes(sampled) if m.eigenvalue is not None]
    assert_close(
        [m.eigenvalue for m in kept],
        [m.eigenvalue for m in fid.modes(continuous)],
        rtol=1e-6,
        why="exact zero-order hold",
    )
    rig = fid.PolynomialModel(
        ("u",), "y", 0.1, a=[1, -2.372, 1.465, 0.2673, -0.351], b=[[0.1, 0.2, 0.1, 0.1]]
    )
    found = fid.modes(rig)
    lost = [m for m in found if m.eigenvalue is None]
    assert [m.reason for m in lost] == [NO_COUNTERPART]
    assert_close(lost[0].root, -0.42, rtol=0.01, why="published pole of the rig")
    assert "no-continuous-counterpart" in {f.code for f in found.findings}
    assert np.isnan(found.natural_frequency_rad_s[-1])
    assert found.modes[-1].named.character == "alternates from sample to sample"
    late = fid.PolynomialModel(("u",), "y", 0.1, f=[[1, -0.5]], b=[[0.0, 0.0, 0.0, 1.0]])
    delays = [m.named.character for m in fid.modes(late) if m.root == 0.0]
    assert delays == ["delay of one sample"] * len(delays)
    assert len(delays) == 3
    table = fid.modes(late).table()
    assert [row[0] for row in table.rows[1:]] == ["3 poles at the origin"]
    assert "3 poles at the origin: delays of one sample each." in table.notes
    assert [row[0] for row in modes_cells(fid.modes(late))] == [
        fid.modes(late).modes[0].named.character,
        "3 delays of one sample each",
    ]


def test_black_box_fits_have_intervals_like_their_roots() -> None:
    random = np.random.default_rng(3)
    u = random.standard_normal(600)
    truth = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])
    record = fid.Record.from_arrays(
        np.arange(600) / 10, inputs={"u": u}, outputs={"y": np.zeros(600)}
    )
    record = record.replace({"y": truth.simulate(record) + 0.1 * random.standard_normal(600)})
    polynomial = fid.identify(fid.PolynomialModel.oe("u", "y", nb=2, nf=2), record)
    innovations = fid.identify(fid.InnovationsModel.subspace("u", "y", order=2), record)
    for fit in (polynomial, innovations):
        mode = fid.modes(fit).modes[0]
        root = next(r for r in fit.details.modes if abs(r.z - mode.root) < 1e-6)
        for mine, theirs in (
            (mode.natural_frequency, root.natural_frequency),
            (mode.damping_ratio, root.damping),
        ):
            assert theirs is not None
            assert mine.interval95 is not None
            assert theirs.stderr is not None
            half = (mine.interval95[1] - mine.interval95[0]) / 2.0
            told = half_width(0.95, theirs.freedom) * theirs.stderr
            assert_close(
                half, told, rtol=2.5e-3, why="one way keeps 591 degrees of freedom to itself"
            )
        assert mode.name == "y"
    # A study's table had dashes without a word: of errors unknown, of a sign unknown, beside green.
    blind = SimpleNamespace(name="blind", fit=replace(polynomial, covariance=None))
    loose = SimpleNamespace(name="loose", fit=replace(polynomial, covariance=None))
    known = SimpleNamespace(name="known", fit=polynomial)
    (table, alone) = (short_modes_table(each) for each in ([blind, loose], [known]))
    (note,) = table.notes
    character = fid.modes(polynomial).modes[0].named.character
    assert note.startswith(f"No interval of blind, {character}; loose, {character}: ")
    assert note.endswith(f"{fid.modes(blind.fit).reason}.")
    assert alone.notes == ("±: half of the 95 % interval.",)


def test_transfer_functions_take_their_slopes_from_differences() -> None:
    model = fid.load_model("rate_second_order")
    omega = np.geomspace(0.5, 40.0, 40)
    data = fid.FrequencyResponse.from_values(
        omega,
        model.frequency_response(omega),
        inputs=model.inputs,
        outputs=model.outputs,
        units=model.units,
        random_error=np.full((1, 1, 40), 0.02),
    )
    fit = fid.identify(model, data)
    mode = fid.modes(fit).modes[0]
    omega_n, zeta = (fit.parameters[name] for name in ("omega_n", "zeta"))
    for mine, theirs in ((mode.natural_frequency, omega_n), (mode.damping_ratio, zeta)):
        assert theirs.interval95 is not None
        assert_close(mine.value, theirs.value, rtol=1e-9, why="the parameter itself")
        assert mine.interval95 is not None
        assert_close(mine.interval95, theirs.interval95, rtol=1e-4, why="the parameter itself")


def test_words_follow_the_states_and_their_names() -> None:
    wing = fid.load_model("fixed_wing_lateral")
    assert [m.name for m in fid.modes(wing)] == ["spiral", "Dutch roll", "roll"]
    system = wing.linear_system()
    renamed = replace(system, states=("sideslip", "rr", "yr", "bank"), units={})
    assert fid.modes(renamed).modes[-1].name == "rr"
    told = fid.modes(
        replace(
            renamed, units=dict(zip(renamed.states, ("rad", "rad/s", "rad/s", "rad"), strict=True))
        ),
        states={"sideslip": "beta", "rr": "p", "yr": "r", "bank": "phi"},
    )
    assert [m.name for m in told] == ["spiral", "Dutch roll", "roll"]
    assert told.modes[-1].participations[0].state == "rr"
    with pytest.raises(errors.UnknownNameError, match="there is no such state: found 'x9'"):
        fid.modes(system, states={"x9": "p"})
    with pytest.raises(errors.UnknownNameError, match="there is no such mode"):
        fid.modes(wing).mode("phugoid")
    with pytest.raises(errors.ModelError, match="there is no linear system in this"):
        fid.modes("a model")


def test_findings_tell_of_growth_and_of_doubt() -> None:
    unstable = fid.modes(fid.load_model("ah64_hover"))
    (finding,) = unstable.findings
    assert finding.code == "unstable-mode"
    assert not unstable.is_stable
    truth = fid.load_model("fixed_wing_lateral")
    omega = np.geomspace(1.0, 20.0, 40)
    shape = (len(truth.outputs), 2, 40)
    data = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega),
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full(shape, 0.3),
    )
    spiral = fid.modes(fid.identify(truth, data)).mode("spiral")
    assert spiral.time_to_half.reason == UNSIGNED
    assert spiral.time_to_half.interval95 is None


def test_a_table_of_modes_is_readable_and_says_what_each_is() -> None:
    table = fid.modes(fid.load_model("fixed_wing_longitudinal")).table()
    words = "phugoid, lightly damped oscillation: pitch attitude 49 %, forward speed 48 %."
    assert words in table.notes
    lines = table.to_text().splitlines()
    assert max(map(len, lines)) <= 160
    assert len(lines) < 20
