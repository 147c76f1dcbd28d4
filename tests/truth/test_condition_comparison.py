"""Conditions side by side: ratios, their intervals, modes that answer to each other, verdicts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid import errors
from flightid.cli.program import run
from flightid.dynamics.conditions.ratios import chance_of, holm, ratio_of
from flightid.dynamics.conditions.result import LEAST_CHANCE
from flightid.uncertainty.estimate import Estimate
from tests.closeness import assert_close


def _fit(truth: fid.StateSpaceModel, seed: int, error: float = 0.05) -> fid.Fit:
    omega = np.geomspace(0.05, 25.0, 40)
    exact = truth.frequency_response(omega)
    random = np.random.default_rng(seed)
    noise = random.standard_normal(exact.shape) + 1j * random.standard_normal(exact.shape)
    data = fid.FrequencyResponse.from_values(
        omega,
        exact * (1.0 + error * noise),
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full(exact.shape, error),
    )
    return fid.identify(truth, data, n_omega=40)


@pytest.fixture(scope="module")
def compared() -> fid.ConditionComparison:
    slow = fid.load_model("fixed_wing_lateral")
    fast = slow.with_values({"Lp": -12.0, "Nbeta": 9.0, "Lr": 3.0})
    return fid.compare_conditions({"slow": _fit(slow, 1), "fast": _fit(fast, 2)})


def test_published_ratios_of_the_r50() -> None:
    """Tables 4 and 5, last column."""
    both = {name: fid.load_model(f"r50_{name}") for name in ("hover", "cruise")}
    found = fid.compare_conditions(both)
    for name, printed in (
        ("tau_f", 0.75), ("hcg", 0.78), ("tau_s", 0.76), ("Xu", 2.41), ("Yv", 1.0), ("Lb", 1.28),
        ("Ma", 1.31), ("Ba", 1.14), ("Bd", 0.93), ("Ab", 0.93), ("Ac", 0.89), ("Zw", 1.65),
        ("Nv", 13.3), ("Nrfb", 0.8), ("Kr", 1.0), ("Krfb", 0.94), ("Blat", 0.88),
        ("Blon", 1.45), ("Alat", 0.85), ("Alon", 0.83), ("Zcol", 1.31), ("Nped", 0.8),
        ("Dlat", 1.06), ("Clon", 0.87), ("tau_ped", 0.59),
    ):  # fmt: skip
        value = found[name].ratios["cruise"].value
        assert_close(value, printed, rtol=0.012, why="printed to two or three digits")
    assert found.only_parameters["hover"] == (
        "Lu", "Lv", "Mu", "Mv", "Zb", "Za", "Zr", "Np", "Nw", "Ncol",
    )  # fmt: skip
    assert [f.code for f in found.findings] == ["stability-changed"]
    assert found["tau_f"].ratios["cruise"].interval95 is None
    assert {m.name for m in found.modes} >= {"heave", "yaw/gyro-feedback"}


def test_changes_are_told_from_noise(compared: fid.ConditionComparison) -> None:
    changed = {f.message.split(":")[0] for f in compared.findings if f.code == "changed"}
    assert {"Lp", "Nbeta", "Dutch roll, natural frequency"} <= changed
    assert not changed & {"Nr", "Ybeta", "Laileron", "Clr"}
    damping = compared["Lp"].ratios["fast"]
    assert damping.interval95 is not None
    assert damping.interval95[0] < 12.0 / 8.402 < damping.interval95[1]
    assert [m.name for m in compared.modes] == ["spiral", "Dutch roll", "roll"]
    assert json.loads(json.dumps(compared.to_dict()))["conditions"] == ["slow", "fast"]
    shown = compared.summary().to_text()
    assert "fast / slow" in shown
    assert "Changed beyond noise: " in shown
    assert "[green]" not in shown
    assert len(compared.modes_table().rows) == 4
    assert compared._repr_html_().count("<table") == 2


def test_turned_signs_and_lost_stability_are_amber() -> None:
    slow = fid.load_model("fixed_wing_lateral")
    turned = slow.with_values({"Np": 0.35, "Lbeta": -4.0})
    found = fid.compare_conditions({"a": _fit(slow, 1, 0.01), "b": _fit(turned, 2, 0.01)})
    signs = [f for f in found.findings if f.code == "sign-changed"]
    assert any(f.message.startswith("Np:") for f in signs)
    assert {f.light.value for f in signs} == {"amber"}
    lost = [f.message for f in found.findings if f.code == "stability-changed"]
    assert lost == ["spiral: unstable in b, stable in the rest", "unstable in b, not in the rest"]


def test_ratios_cover_by_fieller() -> None:
    """Also where the denominator is known to two fifths only, where first order would fail."""
    random = np.random.default_rng(5)
    for error in (0.02, 0.2):
        inside = 0
        runs = 4000
        for above, below in zip(
            random.normal(3.0, error, runs), random.normal(1.0, error, runs), strict=True
        ):
            half = 1.959964 * error
            ratio = ratio_of(
                Estimate("b", above, "1", half / 1.959964),
                Estimate("a", below, "1", half / 1.959964),
            )
            if ratio.interval95 is None:
                # Fieller's set is not bounded there: it holds almost everything.
                inside += 1
                continue
            inside += ratio.interval95[0] <= 3.0 <= ratio.interval95[1]
        assert 0.94 < inside / runs < 0.96


def test_ratios_without_an_answer() -> None:
    known = Estimate("a", 2.0, "1", 0.51)
    none = Estimate("b", None, "1", None, "not there")
    assert ratio_of(none, known).reason == "not there"
    assert ratio_of(known, none).reason == "not there"
    assert ratio_of(known, Estimate("c", 0.0)).reason == "the denominator is zero"
    loose = ratio_of(known, Estimate("d", 1.0, "1", 1.02))
    assert loose.value == 2.0
    assert "holds zero" in loose.reason
    assert chance_of(known, none) is None
    assert chance_of(Estimate("e", 1.0), Estimate("f", 1.0)) is None
    assert chance_of(Estimate("e", 1.0, "1", 0.0), Estimate("f", 1.0)) is None
    assert holm({"a": 0.04, "b": 0.04}) == set()
    assert holm({"a": 0.02, "b": 0.04}) == {"a", "b"}


def test_a_withheld_interval_is_not_an_exact_number() -> None:
    known = Estimate("a", 2.0, "1", 0.1)
    bare = Estimate("b", 3.0, "1", None, "errors are not white")
    fixed = Estimate("c", 3.0, "1", None, "fixed")
    for pair in ((known, bare), (bare, known), (bare, fixed)):
        ratio = ratio_of(*pair)
        assert (ratio.interval95, ratio.reason) == (None, "errors are not white")
        assert ratio.value is not None
        assert chance_of(*pair) is None
    exact = ratio_of(known, fixed).interval95
    assert exact is not None
    half = 1.959963984540054 * 0.1
    assert_close(exact, [(2.0 - half) / 3.0, (2.0 + half) / 3.0], rtol=1e-12, why="one factor")
    assert chance_of(known, fixed) is not None


def test_refused(compared: fid.ConditionComparison) -> None:
    with pytest.raises(errors.OptionError, match="a comparison needs two conditions"):
        fid.compare_conditions({"hover": fid.load_model("r50_hover")})
    box = fid.PolynomialModel(("u",), "y", 0.1, a=[1.0, -0.5], b=[[1.0]])
    with pytest.raises(errors.ModelError, match="condition b has no named parameters"):
        fid.compare_conditions({"a": fid.load_model("r50_hover"), "b": box})
    with pytest.raises(errors.UnknownNameError, match="there is no such common parameter"):
        compared["Zw"]


def test_black_boxes_are_compared_by_modes_gains_and_delays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    boxes = {}
    for name, hertz in (("before", 1.6), ("after", 2.0)):
        # Roots of a pair damped by 0.2, of a lag, and delays of a sample, which are no modes.
        pair = 2.0 * np.pi * hertz * (-0.2 + 1j * np.sqrt(0.96))
        a = np.real(np.poly([*np.exp(0.01 * np.array([pair, pair.conjugate(), -2.0])), 0.0]))
        boxes[name] = fid.PolynomialModel(("u",), "y", 0.01, a=a, b=[[0.0, 1.0]], nk=(3,))
    found = fid.compare_conditions(boxes)
    gains = [float(np.sum(box.b[0]) / np.sum(box.a)) for box in boxes.values()]
    steady = found["steady gain y/u"].values
    assert_close([steady[name].value for name in boxes], gains, rtol=1e-12, why="at z = 1")
    assert [each.value for each in found["delay y/u"].values.values()] == [0.03, 0.03]
    assert [mode.name for mode in found.modes] == ["y at 0.318 Hz", "y at 1.6 Hz"]
    ratios = [mode.numbers[0].ratios["after"].value for mode in found.modes]
    assert_close(ratios, [1.0, 1.25], rtol=1e-9, why="by the roots that were put in")
    assert found.modes_table().title == "Modes, before and after"
    files = [str(fid.write_model(box, tmp_path / f"{name}.toml")) for name, box in boxes.items()]
    assert run(["compare", *files]) == 0
    shown = capsys.readouterr().out
    assert "y at 1.6 Hz, natural frequency" in shown
    assert "--gains FILE" in shown
    assert shown.index("natural frequency") < shown.index("flightid verify"), "what to do is last"
    assert f"flightid verify {files[0]} RECORDS --against {files[1]}" in shown
    assert shown.index("natural frequency") < shown.index("steady gain y/u")
    alone = fid.PolynomialModel(("u",), "y", 0.01, a=[1.0, -0.9], b=[[0.0, 1.0]])
    apart = fid.compare_conditions({"pair": boxes["before"], "lag": alone})
    assert apart.only_modes["pair"] == ("y, lightly damped oscillation: -2.011 ± 9.85i rad/s",)
    (tmp_path / "second-output" / "models").mkdir(parents=True)
    fid.write_model(alone, tmp_path / "second-output" / "models" / "y.toml")
    (tmp_path / "second.csv").write_text("time,u,y\n")
    (tmp_path / "second-output" / "results.json").write_text('{"files": {"second.csv": "0"}}')
    assert run(["compare", files[0], str(tmp_path / "second-output")]) == 0
    asked = f"flightid verify {files[0]} {tmp_path / 'second.csv'} --against"
    assert asked in capsys.readouterr().out


def test_a_chance_that_no_tail_tells_is_no_zero() -> None:
    apart = fid.compare_conditions({
        name: _fit(fid.load_model("rate_first_order", axis="roll").with_values({"Lp": lag}), 1)
        for name, lag in (("slow", -1.0), ("quick", -40.0))
    })  # fmt: skip
    assert apart["Lp"].chances["quick"] < LEAST_CHANCE
    assert "< 1e-15" in apart.summary().to_text()


def test_modes_without_common_states_do_not_answer_to_each_other() -> None:
    both = {n: fid.load_model(f"fixed_wing_{n}") for n in ("longitudinal", "lateral")}
    found = fid.compare_conditions(both)
    assert found.modes == ()
    assert found.only_modes["longitudinal"] == ("phugoid", "short period")
    assert found.only_modes["lateral"] == ("spiral", "Dutch roll", "roll")
    assert found.modes_table().rows == ()


def test_one_rule_judges_parameters_and_modes_together() -> None:
    slow = fid.load_model("fixed_wing_lateral")
    fast = slow.with_values({"Lp": slow.parameters["Lp"].value * 1.04})
    # Seeds with which a rule of its own for modes would call the spiral changed.
    found = fid.compare_conditions({"slow": _fit(slow, 2), "fast": _fit(fast, 102)})
    rows = (*found.parameters, *(n for mode in found.modes for n in mode.numbers))
    chances = {f"{row.name} {name}": p for row in rows for name, p in row.chances.items()}
    said = {f"{f.message.split(':')[0]} fast" for f in found.findings if "changed" in f.code}
    assert said == holm(chances)


def test_models_of_one_record_have_no_changes() -> None:
    """The noise of one record moves both, so that nothing is said of chance; of two it is."""
    truth = fid.load_model("rate_first_order", axis="roll").with_values({"Ltphi": 40.0, "Lp": -4.0})
    time_s = np.arange(0.0, 30.0, 0.02)
    stick = fid.Record.from_arrays(
        time_s, inputs={"tau_phi": 0.2 * np.sin(0.2 * time_s**2)}, hold="zero"
    )

    def flown(seed: int) -> fid.Record:
        noise = fid.Noise(sensor={"p": 0.05}, seed=seed)
        return fid.simulate(truth, stick, units=truth.units, noise=noise)

    first, again = flown(1), flown(2)
    held = truth.with_fixed(Ltphi=40.0)
    base = fid.identify(truth, first, method="output_error")
    rivals = (fid.identify(held, each, method="output_error") for each in (first, again))
    same, other = (fid.compare_conditions({"free": base, "held": each}) for each in rivals)
    assert same["Lp"].chances == {}
    assert same["Lp"].ratios["held"].interval95 is None
    assert "of one record" in same.summary().to_text()
    assert {f.code for f in same.findings} >= {"one-record"}
    assert not {f.code for f in same.findings} & {"changed", "sign-changed"}
    assert 0.0 < other["Lp"].chances["held"] < 1.0
    assert "one-record" not in {f.code for f in other.findings}


def test_a_steady_gain_that_changed_is_told_by_its_interval() -> None:
    fits = {}
    for name, gain in (("before", 1.0), ("same", 1.0), ("after", 1.3)):
        rng = np.random.default_rng(len(fits))
        truth = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[gain]], nk=(2,))
        u, noise = rng.standard_normal((2, 300))
        record = fid.Record.from_arrays(
            0.1 * np.arange(300), inputs={"u": u}, outputs={"y": np.zeros(300)}, hold="zero"
        )
        seen = record.replace({"y": truth.simulate(record) + 0.1 * noise})
        fits[name] = fid.identify(fid.PolynomialModel.oe("u", "y", nb=1, nf=2, nk=2), [seen])
    number = fid.compare_conditions(fits)["steady gain y/u"]
    low, high = number.values["before"].interval95 or (np.nan, np.nan)
    assert low < 5.0 < high < 5.2
    assert number.chances["same"] > 0.01
    assert number.chances["after"] < 1e-6
