"""Intervals of modes cover the truth in 95 of 100 repeated fits (Monte Carlo)."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import flightid as fid

ERROR = 0.03
RUNS = 400


def _measured(truth: fid.StateSpaceModel, seed: int) -> fid.FrequencyResponse:
    omega = np.geomspace(0.05, 25.0, 45)
    exact = truth.frequency_response(omega)
    random = np.random.default_rng(seed)
    noise = random.standard_normal(exact.shape) + 1j * random.standard_normal(exact.shape)
    return fid.FrequencyResponse.from_values(
        omega,
        exact * (1.0 + ERROR * noise),
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full(exact.shape, ERROR),
    )


def _numbers(mode: fid.dynamics.Mode) -> dict[str, fid.dynamics.Estimate]:
    found = {each.name: each for each in mode.quantities}
    for part in mode.participations:
        found[f"share {part.state}"] = part.share
        found[f"size {part.state}"] = part.size
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fixed_wing_lateral", "fixed_wing_longitudinal"])
def test_intervals_of_modes_cover(name: str) -> None:
    truth = fid.load_model(name)
    if name == "fixed_wing_longitudinal":
        truth = truth.with_fixed(Malphadot=-0.898)
    exact = {mode.name: _numbers(mode) for mode in fid.modes(truth)}
    inside: Counter[str] = Counter()
    trials: Counter[str] = Counter()
    for seed in range(RUNS):
        for mode in fid.modes(fid.identify(truth, _measured(truth, seed), n_omega=45)):
            for key, number in _numbers(mode).items():
                true = exact[mode.name][key].value
                if number.interval95 is None or true is None:
                    continue
                where = f"{mode.name}, {key}"
                trials[where] += 1
                inside[where] += number.interval95[0] <= true <= number.interval95[1]
    shares = {key: inside[key] / count for key, count in trials.items()}
    whole = sum(inside.values()) / sum(trials.values())
    assert min(trials.values()) > 0.9 * RUNS
    assert 0.93 < whole < 0.97, whole
    # Four standard errors of a share of 400.
    assert all(0.905 < share < 0.995 for share in shares.values()), shares
