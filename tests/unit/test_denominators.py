"""One denominator for all inputs of OE and BJ models, or one each; the simulator is SciPy's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.errors import ModelError, OptionError
from flightid.identification.prediction_error.coloured_errors import output_error_covariance
from flightid.identification.prediction_error.part_blocks import errors_at, part_blocks
from flightid.models.sampled.channels import gather_channels
from tests.closeness import assert_close

P = fid.PolynomialModel
A, OTHER = [1.0, -1.5, 0.7], [1.0, -1.2, 0.55]
ORDERS = {"inputs": ("u", "v"), "outputs": "y", "nb": 2, "nf": 2, "nk": (1, 2)}
KINDS = {"OE": P.oe(**ORDERS), "BJ": P.bj(**ORDERS, nc=0, nd=1)}
COMMON = P(
    ("u", "v"), "y", 0.1, b=[[1.0, 0.5], [-2.0, 1.0]], d=[1, -0.6], f=[A, A], nk=(1, 2),
    denominators="common",
)  # fmt: skip


def flown(seed, second=A, *, share=0.2, pole=0.6, n=600):
    random = np.random.default_rng(seed)
    u, v, e = random.standard_normal((3, n + 100))
    y = lfilter([0, 1.0, 0.5], A, u) + lfilter([0, 0, -2.0, 1.0], second, v)
    y = y + share * np.std(y) * lfilter([np.sqrt(1 - pole**2)], [1.0, -pole], e)
    u, v, y = (row[100:] for row in (u, v, y))
    return fid.Record.from_arrays(
        np.arange(n) / 10, inputs={"u": u, "v": v}, outputs={"y": y}, hold="zero"
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("second", "chosen"), [(A, "common"), (OTHER, "separate")])
def test_data_choose_and_the_fit_says_so(kind, second, chosen):
    fit = fid.identify(KINDS[kind], flown(1, second))
    assert fit.model.denominators == fit.structure.denominators == chosen
    assert "denominators-chosen" in {finding.code for finding in fit.findings}
    told = fid.identify(replace(KINDS[kind], denominators=chosen), flown(1, second))
    assert_close(fit.model.theta, told.model.theta, rtol=1e-15, why="the same fit")
    assert "denominators-chosen" not in {finding.code for finding in told.findings}


@pytest.mark.parametrize("kind", KINDS)
def test_noise_free_poles_in_common_are_recovered(kind):
    record = flown(2, share=0.0)
    fit = fid.identify(replace(KINDS[kind], denominators="common", offsets="none"), record)
    plant = [fit.parameters[name].value for name in ("b1[u]", "b2[u]", "b2[v]", "b3[v]")]
    assert_close(plant, [1.0, 0.5, -2.0, 1.0], atol=1e-9, why="no noise")
    assert_close(fit.model.f[1], A, atol=1e-9, why="no noise")


def test_nothing_is_said_of_what_leaves_no_choice():
    uneven = P.oe(("u", "v"), "y", nb=2, nf=(2, 1))
    for asked in (P.oe("u", "y", nb=2, nf=2), P.arx(("u", "v"), "y", na=2, nb=2), uneven):
        assert asked.alternatives == (asked,)
    with pytest.raises(OptionError, match="one denominator has one degree"):
        replace(uneven, denominators="common")
    with pytest.raises(ModelError, match="denominators"):
        P(("u", "v"), "y", 0.1, b=[[1.0], [1.0]], f=[A, OTHER], denominators="common")


def test_both_give_the_same_response_and_the_common_one_fewer_states():
    separate = replace(COMMON, denominators="separate")
    assert (COMMON.theta.size, separate.theta.size) == (7, 9)
    assert COMMON.names[-2:] == ("f1", "f2")
    omega = np.array([0.3, 2.0, 9.0])
    for model in (COMMON, separate):
        a, b, c, d, k = model.state_space()
        z = np.exp(0.1j * omega)[:, None, None]
        found = c @ np.linalg.solve(z * np.eye(len(a)) - a, b + 0j) + d
        wanted = np.moveaxis(model.frequency_response(omega), -1, 0)
        assert_close(found, wanted, rtol=1e-11, why="realisation")
        noise = 1.0 + (c @ np.linalg.solve(z * np.eye(len(a)) - a, k + 0j))[:, 0, 0]
        assert_close(noise, 1.0 / (1.0 - 0.6 / z[:, 0, 0]), rtol=1e-11, why="realisation")
    assert len(COMMON.linear_system().a) == 3 < len(separate.linear_system().a)


def test_a_model_file_keeps_the_denominators(tmp_path):
    fit = fid.identify(KINDS["BJ"], flown(3))
    back = fid.load_model(fid.write_model(fit, tmp_path / "y.toml"))
    assert back.structure.is_common
    assert back.names == fit.model.names
    assert_close(back.covariance, fit.model.covariance, rtol=1e-12, why="as written")
    changed = back.with_values({"f1": -1.4})
    assert [row[1] for row in changed.f] == [-1.4, -1.4]
    record = flown(4)
    assert_close(back.simulate(record), fit.model.simulate(record), rtol=1e-9, why="one model")


def test_the_covariance_is_that_of_differences():
    record, asked = flown(5, n=200), replace(KINDS["OE"], denominators="common")
    data = gather_channels([record], "y", ("u", "v"), "mean")
    theta = np.array([1.0, 0.5, -2.0, 1.0, -1.5, 0.7])
    errors = errors_at(asked, data, [], theta)
    blocks = part_blocks(lambda at: errors_at(asked, data, [], at), data, theta, 0)
    slopes = blocks[0].projected.reshape(errors.size, -1)
    found = output_error_covariance(asked, data, theta, errors, 0)
    wanted = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    assert_close(np.sqrt(np.diag(found.white)), wanted, rtol=1e-2, why="slopes hold the errors")


def test_a_scan_ranks_both_and_delivers_what_it_ranked_first():
    scan = fid.scan_orders(flown(6), flown(7), kind="oe", nb=3, nf=[1, 2])
    assert len(scan.trials) == 4
    best = scan.smallest("bic").structure
    assert best.orders_text == "nb [3, 3], nf 2 common, nk [1, 1]"
    assert "2 common" in str(scan.summary())
    assert scan.best.structure.is_common == scan.trials[0].structure.is_common
    told = fid.scan_orders(flown(6), flown(7), kind="oe", nb=3, nf=[1, 2], denominators="separate")
    assert len(told.trials) == 2
