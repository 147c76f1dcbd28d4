"""Verification of a vehicle in a loop and in gusts, by what follows an injected signal."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.identification.prediction.result import Prediction
from flightid.models import LinearSystem
from flightid.validation.verification.by_excitation import followed_parts

STEP_S, EFFECT, DAMPING = 0.02, 40.0, -3.0


def _model(effect: float = EFFECT) -> LinearSystem:
    return LinearSystem([[DAMPING]], [[effect]], [[1.0]], [[0.0]], ("u",), ("p",))


def _flown(seed: int, gust: float, loop: str | None = None) -> fid.Record:
    """A rate under PI with a chirp at the mixer, in gusts of a second's memory: exact, held."""
    random, n = np.random.default_rng(seed), 3000
    time_s = STEP_S * np.arange(n)
    rate = np.log(40.0) / time_s[-1]
    chirp = 0.05 * np.sin(2.0 * np.pi * 0.25 * (np.exp(rate * time_s) - 1.0) / rate)
    a = np.exp(DAMPING * STEP_S)
    b = (a - 1.0) / DAMPING
    keep = np.exp(-STEP_S)
    new = gust * np.sqrt(1.0 - keep**2) * random.standard_normal(n)
    p, u, blown, total = np.zeros(n), np.zeros(n), 0.0, 0.0
    for k in range(n - 1):
        seen = p[k] + 0.01 * random.standard_normal()
        total += 0.2 * seen * STEP_S
        u[k] = chirp[k] - 0.1 * seen - total
        blown = keep * blown + new[k]
        p[k + 1] = a * p[k] + b * (EFFECT * u[k] + blown)
    p += 0.01 * random.standard_normal(n)
    channels = {"inputs": {"u": u}, "outputs": {"p": p}, "excitations": {"r": chirp}}
    return fid.Record.from_arrays(time_s, **channels, hold="zero", loop=loop)


def _lights(model: LinearSystem, record: fid.Record) -> set[Light]:
    return {each.light for each in fid.verify(model, record).findings}


@pytest.mark.parametrize("gust", [2.0, 8.0])
def test_a_right_model_is_not_red_in_gusts_and_a_wrong_gain_is(gust: float) -> None:
    for seed in range(3):
        record = _flown(seed, gust, "closed")
        result = fid.verify(_model(), record)
        assert result.theil["p"] > 0.3, "the free run measures gusts"
        assert Light.RED not in {each.light for each in result.findings}
        assert Light.RED in _lights(_model(0.7 * EFFECT), record)


def test_the_miss_of_a_wrong_gain_is_its_share_of_the_answer() -> None:
    made = fid.verify(_model(0.7 * EFFECT), _flown(1, 2.0)).predictions
    part = followed_parts(made)["p"]
    assert part.missed < 0.3 < part.most
    assert part.chance < 1e-6
    right = followed_parts(fid.verify(_model(), _flown(1, 2.0)).predictions)["p"]
    assert right.missed < 0.05
    assert right.most < 0.15
    assert right.chance > 1e-3


def test_calm_air_confirms_and_records_without_injection_tell_nothing() -> None:
    calm = _flown(2, 0.2, "closed")
    part = followed_parts(fid.verify(_model(), calm).predictions)["p"]
    assert part.is_confirmed
    assert not part.is_refuted

    def told(record: fid.Record) -> dict[str, object]:
        made: tuple[Prediction, ...] = fid.verify(_model(), record).predictions
        return dict(followed_parts(made))

    assert told(calm.declare(loop="open")) == {}
    taken = {name: calm[name] for name in ("u", "p")}
    plain = fid.Record.from_arrays(
        calm.time_s, inputs={"u": taken["u"]}, outputs={"p": taken["p"]}, hold="zero"
    )
    assert told(plain) == {}


def test_right_models_are_rarely_said_to_miss_anything() -> None:
    chances = [
        followed_parts(fid.verify(_model(), _flown(seed, 4.0)).predictions)["p"].chance
        for seed in range(8)
    ]
    assert min(chances) > 1e-3
    assert 0.2 < float(np.mean(chances)) < 0.8
