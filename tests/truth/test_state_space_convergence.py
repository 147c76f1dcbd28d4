"""A 13-state, 40-parameter, 31-response fit finds the truth from starts half its values off."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.state_space_fit import OMEGA, Peer, bounds, make_case, native_fit, vehicle

import flightid as fid
from tests.closeness import assert_close

SPREAD = 0.5


def recovered(seed: int) -> bool:
    truth = vehicle()
    every = truth.with_responses(*[f"{o}/{i}" for o in truth.outputs for i in truth.inputs])
    data = fid.FrequencyResponse.from_values(
        OMEGA,
        every.frequency_response(OMEGA),
        inputs=list(truth.inputs),
        outputs=list(truth.outputs),
        units=truth.units,
    )
    random = np.random.default_rng(seed)
    values = {
        p.name: float(np.clip((p.value or 0.0) * random.uniform(0.5, 1.5), p.minimum, p.maximum))
        for p in truth.parameters.free
    }
    fit = fid.identify(
        truth.with_values(values), data, n_omega=60, minimum_coherence=None, correct_bias=False
    )
    return all(
        abs(fit.parameters[p.name].value / (p.value or 1.0) - 1.0) < 1e-6
        for p in truth.parameters.free
    )


def test_a_few_starts() -> None:
    assert all(recovered(seed) for seed in range(2))


@pytest.mark.slow
def test_ninety_five_of_a_hundred_starts() -> None:
    assert sum(recovered(seed) for seed in range(100)) >= 95


def test_the_benchmark_fits_the_same_problem() -> None:
    case = make_case(0.03, seed=1, spread=0.1)
    assert len(case.model.parameters.free) == 40
    assert len(case.model.response_names) == 31
    assert len(case.model.states) == 13
    peer = Peer(case)
    at, low, high = case.start, *bounds(case.model)
    ours = native_fit(case, at, 1)[0]
    assert np.all((low <= at) & (at <= high))
    end = np.asarray(ours[0])
    weighted = peer.residuals(end)
    assert_close(weighted @ weighted, ours[1], rtol=1e-10, why="one cost")
    there = peer.jacobian(end).reshape(2, len(OMEGA), 31, 40)
    mine = np.asarray(ours[3]).reshape(31, len(OMEGA), 2, 40).transpose(2, 1, 0, 3)
    assert_close(mine, there, rtol=1e-7, atol=1e-8, why="one Jacobian")
