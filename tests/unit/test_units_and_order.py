"""Results know neither units nor the order of records, outputs, inputs, states and parameters.

Factors are powers of two, which no product rounds. What is told twice, of one motion in other
units or another order, is told alike: estimates by their factors, their errors and freedom, the
chances behind each light, and its words.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from tests.closeness import assert_close

STEP_S = 0.02
PLAIN = {"p": 1.0, "r": 1.0, "da": 1.0, "dr": 1.0}
OTHER = {"p": 64.0, "r": 0.125, "da": 0.25, "dr": 16.0}
TRUTH = {"Lp": -3.0, "Lr": 1.2, "Lda": 10.0, "Np": -0.4, "Nr": -1.1, "Ndr": -4.0}
OF = {
    "Lp": ("p", "p"), "Lr": ("p", "r"), "Lda": ("p", "da"),
    "Np": ("r", "p"), "Nr": ("r", "r"), "Ndr": ("r", "dr"),
}  # fmt: skip
EQUATIONS = {"p": "Lp*p + Lr*r + Lda*da", "r": "Nr*r + Np*p + Ndr*dr"}


def _factor(name: str, units: dict[str, float]) -> float:
    """Of a coefficient: its derivative's over its variable's."""
    rate, by = OF[name]
    return units[rate] / units[by]


def _model(units: dict[str, float], order: int) -> fid.StateSpaceModel:
    """Started a fifth off; in reversed order where that is -1."""
    names = list(TRUTH)[::order]
    axes, inputs = ["p", "r"][::order], ["da", "dr"][::order]
    return fid.StateSpaceModel(
        states=dict.fromkeys(axes, "rad/s"),
        input_units=dict.fromkeys(inputs, "rad"),
        measurements={each: fid.Output(each, "rad/s") for each in axes},
        equations={f"{each}'": EQUATIONS[each] for each in axes},
        parameters=fid.Parameters(
            [
                fid.Parameter(n, 0.8 * TRUTH[n] * _factor(n, units), "1/s^2" if "d" in n else "1/s")
                for n in names
            ]
        ),
        name="lateral",
    )


def _flight(
    seed: int, units: dict[str, float], order: int, gusts: float, n: int = 420
) -> fid.Record:
    """Steps on both axes; noise of two levels, coloured on the second where no gusts are."""
    random = np.random.default_rng(seed)
    axes, inputs = ["p", "r"][::order], ["da", "dr"][::order]
    moved = {
        name: size * np.repeat(random.choice([-1.0, 0.0, 1.0], n // 35 + 1), 35)[:n]
        for name, size in (("da", 0.05), ("dr", 0.08))
    }
    a = np.array([[TRUTH["Lp"], TRUTH["Lr"]], [TRUTH["Np"], TRUTH["Nr"]]])
    b = np.diag([TRUTH["Lda"], TRUTH["Ndr"]])
    value, vector = np.linalg.eig(a)
    phi = np.real(vector * np.exp(value * STEP_S) @ np.linalg.inv(vector))
    gamma = np.linalg.solve(a, (phi - np.eye(2)) @ b)
    state, states = np.zeros(2), []
    for u in np.array([moved["da"], moved["dr"]]).T:
        states.append(state)
        state = phi @ state + gamma @ u + gusts * np.array([0.02, 0.01]) * random.standard_normal(2)
    clean = dict(zip(("p", "r"), np.array(states).T, strict=True))
    noise = {
        "p": 0.03 * random.standard_normal(n),
        "r": lfilter([0.01], [1.0, -0.6 * (1.0 - gusts)], random.standard_normal(n)),
    }
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={each: units[each] * moved[each] for each in inputs},
        outputs={each: units[each] * (clean[each] + noise[each]) for each in axes},
        units={"da": "rad", "dr": "rad", "p": "rad/s", "r": "rad/s"},
        hold="zero",
    )


def _fit(
    method: str,
    units: dict[str, float],
    order: int,
    gusts: float | None = None,
    seeds: tuple[int, ...] = (1, 2, 3),
) -> Any:
    if gusts is None:
        gusts = 1.0 if method == "filter_error" else 0.0
    records = [_flight(seed, units, order, gusts) for seed in seeds[::order]]
    return fid.identify(_model(units, order), records, method=method, loop="open")


def _numbers(told: object, place: str = "") -> Iterator[tuple[str, float]]:
    """All numbers of a result with where they stand, but a logarithm of what has a unit.

    Nor the steps of a search, of which rounding near its end makes one more or less.
    """
    if isinstance(told, dict):
        for key, each in told.items():
            if key not in ("objective", "iterations"):
                yield from _numbers(each, f"{place}.{key}")
    elif isinstance(told, list | tuple):
        for k, each in enumerate(told):
            yield from _numbers(each, f"{place}[{k}]")
    elif isinstance(told, int | float):
        yield place, float(told)


def _judged(method: str, units: dict[str, float]) -> dict[str, object]:
    """What a fit tells; what it tells in units stands in numbers, not in words."""
    if method == "response":
        records = [_flight(seed, units, 1, 0.0) for seed in (1, 2, 3)]
        return fid.estimate_response(records, loop="open").to_dict()
    fit = _fit(method, units, 1)
    words = [(each.name, each.light, each.limit) for each in fit.evidence.checks]
    return {"fit": fit.to_dict(), "words": repr(words)}


@pytest.mark.parametrize("method", ["output_error", "equation_error", "filter_error", "response"])
def test_other_units_scale_every_number_by_a_power_of_two(method: str) -> None:
    one, two = (_judged(method, units) for units in (PLAIN, OTHER))
    assert one.get("words") == two.get("words")
    first, second = list(_numbers(one)), list(_numbers(two))
    assert [place for place, _ in first] == [place for place, _ in second]
    before, after = (np.array([number for _, number in each]) for each in (first, second))
    assert np.array_equal(np.sign(before), np.sign(after))
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.where(before == after, 0.0, np.log2(after / before))
    wrong = np.flatnonzero(~(np.abs(steps - np.rint(steps)) < 1e-3))
    assert not [(first[k], second[k][1]) for k in wrong]


@pytest.mark.parametrize(
    ("method", "near"), [("output_error", 1e-4), ("equation_error", 1e-4), ("filter_error", 1e-2)]
)
def test_another_order_tells_the_same(method: str, near: float) -> None:
    first, second = (_fit(method, PLAIN, order) for order in (1, -1))
    for name in TRUTH:
        one, two = (each.parameters[name] for each in (first, second))
        for kind in ("value", "stderr", "freedom", "cramer_rao_percent", "insensitivity_percent"):
            assert_close(
                getattr(two, kind),
                getattr(one, kind),
                rtol=near,
                why=f"{kind} of {name}: an end of the search, in sums of another order",
            )
    lights = [[(e.name, e.light) for e in each.evidence.checks] for each in (first, second)]
    assert lights[0] == lights[1]


@pytest.mark.parametrize(("gusts", "first"), [(0.0, 7), (0.0, 10), (0.15, 1)])
def test_no_order_chooses_a_filter_whose_noises_are_nearly_none(gusts: float, first: int) -> None:
    """Coloured noise that a gust explains leaves an output none of its own, or states have none."""
    seeds = tuple(range(first, first + 3))
    one, two = (_fit("filter_error", PLAIN, order, gusts, seeds).parameters for order in (1, -1))
    for name in TRUTH:
        assert_close(two[name].value, one[name].value, rtol=1e-5, why="an end of the search")
        for kind, near in (("stderr", 1e-2), ("freedom", 0.2)):
            assert_close(
                getattr(two[name], kind),
                getattr(one[name], kind),
                rtol=near,
                why=f"{kind} of {name}: innovations are whitened in one order",
            )
