"""Eigenvalues of a fit: their values, their propagated errors, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid import errors
from flightid.dynamics import Eigenvalue, eigenvalue_table, eigenvalues_of
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
    found = eigenvalues_of(fit)
    sizes = [each.natural_rad_s for each in found]
    assert sizes == sorted(sizes)
    assert all(each.value.imag >= 0.0 for each in found)
    assert sum(2 if each.value.imag else 1 for each in found) == 13
    table = eigenvalue_table(found, "R-50")
    assert len(table.rows) == len(found)
    assert table.title == "R-50"


def test_errors_are_those_of_the_parameters_carried_through(fit: fid.Fit) -> None:
    """Against differences of the eigenvalues themselves along each parameter."""
    roll = next(e for e in eigenvalues_of(fit) if abs(e.value.imag - 11.56) < 0.1)
    columns = []
    for name in fit.names:
        step = 1e-4 * fit.parameters[name].value
        ends = []
        for sign in (1.0, -1.0):
            there = fit.model.eigenvalues({name: fit.parameters[name].value + sign * step})
            ends.append(there[np.argmin(abs(there - roll.value))])
        ahead, behind = ends
        change = (ahead - behind) / (2.0 * step)
        sizes = (abs(ahead) - abs(behind)) / (2.0 * step)
        ratio = (-ahead.real / abs(ahead) + behind.real / abs(behind)) / (2.0 * step)
        columns.append([change.real, change.imag, sizes, ratio])
    slopes = np.array(columns)
    expected = np.sqrt(np.einsum("ia,ij,ja->a", slopes, fit.covariance, slopes))
    assert roll.deviations is not None
    assert_close(roll.deviations, expected, rtol=1e-5, why="central differences")
    assert_close(roll.half_widths, 1.96 * expected, rtol=1e-4, why="1.95996")


def test_no_errors_without_covariance_and_no_eigenvalues_without_states(fit: fid.Fit) -> None:
    bare = eigenvalues_of(replace(fit, covariance=None))
    assert all(each.deviations is None and each.half_widths is None for each in bare)
    with pytest.raises(errors.ModelError, match="eigenvalues need a state-space model"):
        eigenvalues_of(replace(fit, model=fid.load_model("rate_integrator")))
    assert Eigenvalue(0j).damping == 1.0
