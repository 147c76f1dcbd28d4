"""Model files from strangers: a model or a typed error, whatever is in them."""

from __future__ import annotations

import contextlib
import tomllib
from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import flightid as fid
from flightid.errors import FlightidError
from flightid.models import StateSpaceModel
from flightid.models.kinds import model_from_description
from tests.examples import examples

LIBRARY = files("flightid.models") / "library"
# Small models that hold every kind of table.
WHOLE = """
kind = "state-space"
[states]
x = "m"
v = "m/s"
[inputs]
f = "N"
[outputs]
x = "x"
a = { expression = "v' + k/m*x", unit = "m/s^2" }
[parameters]
m = { value = 2.0, unit = "kg" }
k = { value = 3.0, unit = "N/m", min = 0.0, max = 9.0 }
T = { value = 0.1, unit = "s" }
w = { unit = "1/s" }
[constraints]
w = "1/T"
[definitions]
spring = { expression = "k*clip(x, -1*one, one)*soft(x/one)", unit = "N" }
[constants]
one = { value = 1.0, unit = "m" }
[equations]
"x'" = "v"
"m*v'" = "where(v > 0, f, 0.5*f) - spring"
[delays]
f = "0.5*T"
[tables]
soft = { axes = [{ points = [-1, 0, 2] }], values = [1, 1.5, 2], interpolation = "pchip", \
outside = "hold" }
[blocks]
act = { at = "f", kind = "butterworth", omega = "w", order = 2 }
gyro = { at = "x", kind = "transfer", numerator = [1.0], denominator = ["T", 1.0] }
[trim]
x = 0.1
[initial]
x = { value = 0.0, min = -1.0, max = 1.0 }
[biases]
a = { free = true }
"""
SEEDS = [WHOLE] + [
    (LIBRARY / f"{name}.toml").read_text(encoding="utf-8")
    for name in ("short_period", "fixed_wing_lateral_coefficients", "rate_first_order")
]
SCRAPS = ["'", '"', "=", "{", "}", "[", "]", "(", ")", "*", "^", "'", "-", "1e999", "nan", "inf"]
SCRAPS += [
    "m",
    "k",
    "x'",
    "soft(",
    "where(",
    "clip(",
    "0",
    "[tables]",
    "[blocks]",
    "1/s",
    "rad",
    "\x00",
]


def _judge(model: object) -> None:
    """A model that was taken can be asked for everything, or says in a typed error why not."""
    if not isinstance(model, StateSpaceModel):
        return
    for question in (
        model.matrices, model.matrix_second_derivatives, model.latex, model.summary,
        model.eigenvalues, model.trimmed,
    ):  # fmt: skip
        with contextlib.suppress(FlightidError):
            question()
    assert StateSpaceModel.from_dict(model.to_dict()).to_dict() == model.to_dict()


@st.composite
def _mutated(draw: st.DrawFn) -> str:
    text = draw(st.sampled_from(SEEDS))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        stop = min(len(text), start + draw(st.integers(0, 12)))
        scrap = draw(st.sampled_from(SCRAPS) | st.text(max_size=3))
        other = draw(st.integers(0, len(text)))
        copied = text[other : other + draw(st.integers(0, 30))]
        text = text[:start] + draw(st.sampled_from([scrap, copied])) + text[stop:]
    return text


@given(_mutated())
@settings(examples(120), suppress_health_check=[HealthCheck.too_slow])
def test_a_damaged_file_is_a_model_or_a_typed_error(text: str) -> None:
    try:
        content = tomllib.loads(text)
        content.pop("axes", None)
        model = model_from_description(content)
    except (FlightidError, tomllib.TOMLDecodeError):
        return
    _judge(model)


LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
ITEMS = st.recursive(
    LEAVES,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3)
    ),
    max_leaves=5,
)


@given(st.sampled_from(sorted(tomllib.loads(WHOLE))), ITEMS, st.data())
@examples(120)
def test_any_value_in_any_place_is_judged(key: str, item: object, data: st.DataObject) -> None:
    content = tomllib.loads(WHOLE)
    table = content[key]
    if isinstance(table, dict) and data.draw(st.booleans()):
        table[data.draw(st.sampled_from(sorted(table)))] = item
    else:
        content[key] = item
    try:
        model = model_from_description(content)
    except FlightidError:
        return
    _judge(model)


def test_the_seed_itself_is_a_model() -> None:
    model = model_from_description(tomllib.loads(WHOLE))
    _judge(model)
    assert list(model.states) == ["x", "v", "act_1", "act_2", "gyro_1"]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "text",
    [
        "kind='state-space'\n[states]\n" + "\n".join(f"x{k}='1'" for k in range(2_000)),
        "kind='state-space'\nstates=" + "[" * 2_000,
        "[parameters]\na={value=1" + "0" * 400 + "}",
        WHOLE.replace('"v"', '"' + "(" * 300 + 'v"'),
        WHOLE.replace('"v"', '"' + "v+" * 6_000 + 'v"'),
        WHOLE.replace("order = 2", "order = 1000000000"),
        WHOLE.replace("[-1, 0, 2]", str(list(range(20_000)))),
        WHOLE + "\n".join(f"b{k} = {{ at = 'f', kind = 'washout', T = 1 }}" for k in range(900)),
    ],
    ids=["states", "nesting", "digits", "brackets", "terms", "order", "table", "blocks"],
)
def test_hostile_sizes_are_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "hostile.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FlightidError):
        fid.load_model(path)
