"""Reduction of structures: what is not there goes, what is there stays, and the path says all."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, FitError, ModelError, OptionError, UnknownNameError
from flightid.identification.reduction.reduce import resume
from flightid.identification.reduction.rules import ReductionLimits, choose, explained_rise
from flightid.plot.reduction import reduction_path
from flightid.uncertainty.quantiles import half_width
from tests.closeness import assert_close
from tests.roll_and_yaw import ABSENT, REAL, lateral, measured


def full_fit(data: fid.FrequencyResponse) -> fid.Fit:
    start = {"Lp": -2.0, "La": 20.0, "Nr": -0.7, "Nd": -5.0, "Ld": 0.3, "Lz": 0.5, "Nz": -0.3}
    model = lateral().with_fixed(T=0.1).with_values(start)
    return fid.identify(model, data, minimum_coherence=None, correct_bias=False)


@pytest.fixture(scope="module")
def data() -> fid.FrequencyResponse:
    return measured()


@pytest.fixture(scope="module")
def fit(data: fid.FrequencyResponse) -> fid.Fit:
    return full_fit(data)


@pytest.fixture(scope="module")
def reduction(fit: fid.Fit, data: fid.FrequencyResponse) -> fid.Reduction:
    return fid.reduce(fit, data)


def test_what_is_not_there_goes_and_what_is_there_stays(reduction: fid.Reduction) -> None:
    assert set(reduction.dropped) == set(ABSENT)
    assert set(reduction.fit.names) == set(REAL)
    for name, value in REAL.items():
        p = reduction.fit.parameters[name]
        assert p.stderr is not None
        assert abs(p.value - value) < 4.0 * p.stderr, name


def test_each_step_takes_the_largest_insensitivity_above_its_guide(
    fit: fid.Fit, reduction: fid.Reduction
) -> None:
    before = fit
    for step in reduction.path:
        percents = {n: before.parameters[n].insensitivity_percent or 0.0 for n in before.names}
        largest = max(percents, key=lambda name: percents[name])
        if percents[largest] > 10.0:
            assert step.name == largest
            assert step.reason == f"insensitivity {percents[largest]:.3g} %"
        else:
            assert step.reason.startswith(("Cramér–Rao", "correlated"))
        assert step.cost_before == before.average_cost
        assert step.fit is not None
        assert step.accepted
        before = step.fit


@pytest.mark.parametrize("seed", range(1, 5))
def test_other_noise_leads_to_the_same_structure(seed: int) -> None:
    data = measured(seed)
    assert set(fid.reduce(full_fit(data), data, after_rise="next").dropped) == set(ABSENT)


def test_a_marked_rise_ends_the_path_or_tries_the_next(
    fit: fid.Fit, data: fid.FrequencyResponse
) -> None:
    strict = {"maximum_insensitivity_percent": 1e-3, "maximum_cost_rise_percent": 5.0}
    ended = fid.reduce(fit, data, **strict)
    last = ended.path[-1]
    assert not last.accepted
    assert last.name in REAL
    assert "would rise to" in last.note
    assert f"dropping {last.name} raises the cost markedly" in ended.stopped
    assert last.name in ended.fit.names
    assert "reduction-stays" in [f.code for f in ended.findings]
    every = fid.reduce(fit, data, after_rise="next", **strict)
    assert {step.name for step in every.path} == {*REAL, *ABSENT}
    assert set(every.dropped) == set(ABSENT)


def test_the_rise_is_judged_in_one_step_and_from_the_start() -> None:
    limits = ReductionLimits()
    assert limits.excess(1.0, 1.0, 1.019, 0.0, ()) == ""
    # Nine in a hundred at once are no longer hidden by a floor of 0.1.
    assert limits.excess(0.774, 0.774, 0.844, 0.0, ()) == "by 9.04 % in one step"
    assert limits.excess(1.0, 1.04, 1.055, 0.0, (0.0, 0.0)) == "by 5.5 % from the start"
    # What random error explains is no reason to keep a parameter; exact data have none.
    assert limits.excess(0.774, 0.774, 0.844, 0.08, ()) == ""
    assert limits.excess(1e-9, 1e-9, 5e-4, 0.0, ()) == ""
    assert ReductionLimits(negligible_cost=0.0).excess(1e-9, 1e-9, 5e-4, 0.0, ()) != ""


def test_random_error_explains_what_a_parameter_of_zero_costs() -> None:
    rises, explained = [], []
    for seed in range(20):
        data = measured(seed)
        fit = full_fit(data)
        without = fid.reduce(fit, data, drop=["Ld"], keep=fit.names)
        rises.append(without.path[0].rise_percent * fit.average_cost / 100.0)
        explained.append(explained_rise(fit, "Ld"))
    # Its square is of one degree of freedom: its mean is the explained rise over 2.97 squared.
    assert 0.4 < np.mean(rises) / np.mean(explained) * half_width(0.997) ** 2 < 2.2
    assert explained_rise(full_fit(measured(0)), "La") < 1.0


def test_what_the_cost_needs_makes_the_path_red(fit: fid.Fit, data: fid.FrequencyResponse) -> None:
    def light(reduction: fid.Reduction) -> str:
        return reduction.path_findings[0].light.value

    assert light(fid.reduce(fit, data)) == "green"
    assert light(fid.reduce(fit, data, drop=["Np"])) == "red"
    held = fid.reduce(fit, data, keep=ABSENT)
    assert light(held) == "amber"
    ended = fid.reduce(fit, data, maximum_insensitivity_percent=1e-3)
    codes = {each.code: each for each in ended.path_findings}
    assert "reduction-ended" in codes
    assert 'after_rise="next"' in codes["reduction-ended"].action


def test_by_hand_keep_drop_and_values(fit: fid.Fit, data: fid.FrequencyResponse) -> None:
    found = fid.reduce(fit, data, keep=["Ld"], drop=["Nz", "Lz"], at={"Nz": 0.05})
    assert [(s.name, s.value, s.reason) for s in found.path[:2]] == [
        ("Nz", 0.05, "by hand"),
        ("Lz", 0.0, "by hand"),
    ]
    assert "Ld" in found.fit.names
    assert found.fit.model.parameters["Nz"].value == 0.05
    assert found.fit.parameters["Nz"].status == "fixed"


def test_any_step_can_be_taken_up_again(
    reduction: fid.Reduction, fit: fid.Fit, data: fid.FrequencyResponse
) -> None:
    same = resume(reduction, 1)
    assert same.path[0] is reduction.path[0]
    assert list(same.dropped) == list(reduction.dropped)
    assert_close(same.fit.cost, reduction.fit.cost, rtol=1e-9, why="the same steps")
    assert resume(reduction).path == reduction.path
    other = resume(reduction, 0, keep=["Lz"])
    assert "Lz" in other.fit.names
    assert other.start is fit
    further = resume(other, drop=["Lz"])
    assert list(further.dropped)[-1] == "Lz"
    assert further.keep == ("Lz",)
    assert reduction.fit_after(0) is fit
    with pytest.raises(OptionError, match="the path has no such step"):
        resume(reduction, 9)
    assert fid.reduce(fit, data).dropped == reduction.dropped


def test_ties_follow_and_bounds_without_zero_hold_the_value(data: fid.FrequencyResponse) -> None:
    tied = lateral().with_tie("Ld", "0.5*Na").with_fixed(Lz=0.0, Nz=0.0).with_free("T")
    tied = tied.with_values({"La": 20.0}).with_fixed(T=0.1)
    fit = fid.identify(tied, data, minimum_coherence=None)
    found = fid.reduce(fit, data, drop=["Na"], keep=["Lp", "Lr", "La", "Nr", "Np", "Nd"])
    assert found.fit.parameters["Na"].value == 0.0
    assert found.fit.parameters["Ld"].value == 0.0
    assert found.fit.parameters["Ld"].status == "tied"
    with pytest.raises(OptionError, match="parameter Ld cannot be dropped"):
        fid.reduce(fit, data, drop=["Ld"])
    lagged = lateral().with_fixed(Lz=-2.0, Nz=0.5, Ld=0.0)
    fit = fid.identify(lagged, measured(noise=1e-3), minimum_coherence=None)
    held = fid.reduce(fit, measured(noise=1e-3), drop=["T"])
    assert held.path[0].value == fit.parameters["T"].value
    assert "its bounds leave out zero" in held.path[0].note
    assert "reduction-held" in [f.code for f in held.findings]


def test_a_correlated_pair_loses_the_one_seen_less(fit: fid.Fit) -> None:
    correlation = np.eye(len(fit.names))
    i, j = fit.names.index("Np"), fit.names.index("Nd")
    correlation[i, j] = correlation[j, i] = -0.995
    pair = replace(fit, correlation=correlation)
    loose = ReductionLimits(1e9, 1e9)
    slack = {name: pair.parameters[name].insensitivity_percent or 0.0 for name in ("Np", "Nd")}
    candidate = choose(pair, loose, keep=())
    assert candidate is not None
    assert candidate.name == max(slack, key=lambda name: slack[name])
    assert "correlated by -0.995 with" in candidate.reason
    only = choose(pair, loose, keep=[candidate.name])
    assert only is not None
    assert {only.name, candidate.name} == {"Np", "Nd"}
    assert choose(pair, loose, keep=["Np", "Nd"]) is None


def test_a_parameter_without_which_nothing_is_left_stays(data: fid.FrequencyResponse) -> None:
    model = lateral().with_fixed(Lp=-3.0, Lr=0.8, Nr=-0.9, Np=-0.4, T=0.1, Lz=0.0, Nz=0.0, Ld=0.0)
    model = model.with_responses("p/a", "r/a").with_fixed(Nd=-6.0, Na=0.0).with_values({"La": 20.0})
    fit = fid.identify(model, data, minimum_coherence=None)
    found = fid.reduce(fit, data, maximum_insensitivity_percent=1e-6)
    assert found.path[0].cost_after is None
    assert not found.path[0].accepted
    assert "no free parameter" in found.path[0].note
    with pytest.raises(FitError, match="no free parameter"):
        fid.reduce(fit, data, drop=["La"])


def test_refusals(fit: fid.Fit, data: fid.FrequencyResponse) -> None:
    with pytest.raises(OptionError, match="after_rise is not known"):
        fid.reduce(fit, data, after_rise="hope")
    with pytest.raises(OptionError, match="maximum_correlation is too small"):
        fid.reduce(fit, data, maximum_correlation=0.0)
    with pytest.raises(UnknownNameError, match="no such parameter"):
        fid.reduce(fit, data, keep=["Lq"])
    with pytest.raises(OptionError, match="this fit has no such option"):
        fid.reduce(fit, data, n_frequencies=7)
    with pytest.raises(DataError, match="the fit was made from other data"):
        fid.reduce(fit, measured(seed=9))
    bounded = replace(fit.model.parameters["Nz"], minimum=-1.0, maximum=1.0, value=0.1)
    model = replace(fit.model, parameters=fit.model.parameters.with_parameter(bounded))
    with pytest.raises(ModelError, match="outside its bounds"):
        fid.reduce(replace(fit, model=model), data, drop=["Nz"], at={"Nz": 7.0})


def test_views(reduction: fid.Reduction) -> None:
    assert repr(reduction).startswith("Reduction('roll and yaw', 10 to 7 free parameters in 3 st")
    table = reduction.summary()
    assert [row[1] for row in table.rows] == ["", *reduction.dropped]
    plain = json.loads(json.dumps(reduction.to_dict(), allow_nan=False))
    assert plain["schema"] == "flightid.reduction/1"
    assert [step["name"] for step in plain["path"]] == list(reduction.dropped)
    assert "<table" in reduction._repr_html_()
    figure = reduction_path(reduction)
    curve = figure.data[0]
    assert list(curve.y) == [reduction.start.average_cost, *(s.cost_after for s in reduction.path)]
    undone = fid.reduce(
        reduction.fit, reduction.data, maximum_insensitivity_percent=1e-3, correct_bias=False
    )
    assert "undone" in [trace.name for trace in reduction_path(undone).data]
    assert undone.path[0].rise_percent is not None
    assert undone.path[0].rise_percent > 2.0


def test_structures_side_by_side(
    fit: fid.Fit, reduction: fid.Reduction, data: fid.FrequencyResponse
) -> None:
    poor = fid.identify(
        reduction.fit.model.with_fixed(Np=0.0), data, minimum_coherence=None, correct_bias=False
    )
    found = fid.compare_structures({"full": fit, "reduced": reduction.fit, "poor": poor})
    assert found.best == "reduced"
    n = 2 * sum(len(each.omega_rad_s) for each in fit.responses)
    by_hand = n * np.log(fit.cost / reduction.fit.cost) + 2 * 3
    assert_close(found.rows["full"].criterion, by_hand, rtol=1e-9, why="n ln(J/n) + 2k")
    assert (found.rows["poor"].criterion or 0.0) > 50.0
    assert found.rows["full"].n_outside >= 3
    assert [f.code for f in found.findings].count("structure-outside") >= 1
    assert len(found.summary().rows) == 3
    assert json.loads(json.dumps(found.to_dict()))["best"] == "reduced"
    assert "<table" in found._repr_html_()
    assert repr(found) == "StructureComparison(3 structures, best 'reduced')"
    likely = [
        fid.identify(f.model, data, cost="likelihood", minimum_coherence=None, correct_bias=False)
        for f in (fit, reduction.fit)
    ]
    both = fid.compare_structures({"full": likely[0], "reduced": likely[1]})
    gain = likely[1].objective - likely[0].objective
    assert_close(
        (both.rows["reduced"].criterion or 0.0) - (both.rows["full"].criterion or 0.0),
        gain - 6.0,
        rtol=1e-9,
        why="χ² + 2k",
    )


def test_structures_that_cannot_be_compared(fit: fid.Fit, reduction: fid.Reduction) -> None:
    with pytest.raises(OptionError, match="nothing to compare"):
        fid.compare_structures({"one": fit})
    with pytest.raises(DataError, match="fitted to different data"):
        fid.compare_structures({"one": fit, "other": full_fit(measured(seed=3))})
    changed = {**fit.provenance, "options": {"cost": "likelihood"}}
    with pytest.raises(OptionError, match="different options"):
        fid.compare_structures({"one": fit, "other": replace(fit, provenance=changed)})
    exact = measured(noise=0.0)
    clean = full_fit(exact)
    same = fid.compare_structures({"one": clean, "again": clean})
    assert same.best is None
