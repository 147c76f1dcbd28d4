"""Black-box models and bare matrices in model files: there, back, and refused where they lie."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import FlightidError, ModelError
from flightid.models import Lag, NarxModel, Term, load_structure
from flightid.models.kinds import model_from_description, model_to_description
from flightid.models.narx.scaling import Scaling

ARMAX = fid.PolynomialModel(
    ("v", "w"), "theta", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5], [0.3]], c=[1, 0.2], nk=(2, 1),
    noise_variance=0.01, covariance=np.eye(6) * 1e-4, units={"theta": "rad", "v": "V"},
)  # fmt: skip
INNOVATIONS = fid.InnovationsModel(
    ("lat",), ("p", "q"), 0.02, [[0.8, 0.1], [0.0, 0.3]], [[2.0], [1 / 3]], np.eye(2),
    k=[[0.1, 0.0], [0.0, 0.2]], noise_covariance=np.diag([1e-3, 2e-3]), units={"p": "rad/s"},
)  # fmt: skip
STRUCTURE = fid.NarxStructure(("u",), "y", 2, 1, degree=2, width=1.3)
NARX = NarxModel(
    STRUCTURE,
    (
        Term("constant"),
        Term("y(t-1)", ((Lag("y", 1), 1),)),
        Term("y(t-2) u(t-1)^2", ((Lag("y", 2), 1), (Lag("u", 1), 2))),
        Term("radial", centre=(0.1, -0.2, 0.3)),
    ),
    (0.01, 0.8, -0.05, 0.3),
    Scaling({"y": 1.0, "u": 0.5}, {"y": 2.0, "u": 0.25}, {"y": "rad", "u": "V"}, 0.1, (-2.0, 2.0)),
)


@pytest.mark.parametrize("model", [ARMAX, INNOVATIONS, NARX], ids=lambda m: type(m).__name__)
def test_round_trip_through_toml(model: object, tmp_path: Path) -> None:
    back = fid.load_model(fid.write_model(model, tmp_path / "model.toml"))
    assert type(back) is type(model)
    assert model_to_description(back) == model_to_description(model)


def test_a_narx_equation_runs_as_before(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    record = fid.Record.from_arrays(
        np.arange(60) * 0.1,
        inputs={"u": rng.standard_normal(60)},
        outputs={"y": rng.standard_normal(60)},
        units={"u": "V", "y": "rad"},
    )
    back = fid.load_model(fid.write_model(NARX, tmp_path / "narx.toml"))
    assert np.array_equal(*(fid.predict(model, record).predicted["y"] for model in (back, NARX)))


def test_a_narx_model_without_radial_terms_stays_so(tmp_path: Path) -> None:
    bare = fid.NarxStructure(("u",), "y", 1, 1, kernel=None)
    equation = NarxModel(bare, (Term("constant"),), (1.0,), NARX.scaling)
    back = fid.load_model(fid.write_model(equation, tmp_path / "narx.toml"))
    assert back.structure.kernel is None


def test_black_boxes_are_no_structures_to_fit(tmp_path: Path) -> None:
    path = fid.write_model(INNOVATIONS, tmp_path / "model.toml")
    with pytest.raises(ModelError, match="no named parameters to fit"):
        load_structure(path)
    with pytest.raises(ModelError, match="cannot be written as a model"):
        fid.write_model(STRUCTURE, tmp_path / "model.toml")  # type: ignore[arg-type]


BROKEN = {
    "kind": ({"kind": "magic"}, "kind of model is not known"),
    "kind of another type": ({"kind": ["transfer"]}, "kind of model is not known"),
    "linear key": ({"kind": "linear", "inputs": ["u"], "outputs": ["y"], "e": 1}, "unknown key"),
    "no inputs": ({"kind": "linear", "outputs": ["y"]}, "has no inputs"),
    "twice": ({"kind": "linear", "inputs": ["u", "u"], "outputs": ["y"]}, "given twice"),
    "shape": (
        {"kind": "linear", "inputs": ["u"], "outputs": ["y"], "d": [[1.0, 2.0]]},
        "does not fit the names",
    ),
    "not a list": ({"kind": "linear", "inputs": "u", "outputs": ["y"]}, "must be a list"),
    "delay": (
        {"kind": "linear", "inputs": ["u"], "outputs": ["y"], "delays_s": [-1.0]},
        "do not make a linear system",
    ),
    "innovations": ({"kind": "innovations", "outputs": ["p"], "inputs": ["u"]}, "must be a number"),
    "innovations k": (
        {"kind": "innovations", "outputs": ["p"], "inputs": ["u"], "sample_time_s": 0.1,
         "a": [[0.5]], "k": [[1.0, 2.0]]},
        "does not fit the names",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_files_that_contradict_themselves(case: str) -> None:
    content, words = BROKEN[case]
    with pytest.raises(ModelError, match=words):
        model_from_description(content)


CHANGES = {
    "scaling of a channel": (("scaling", "mean"), {"y": 1.0}, "mean of channel u is missing"),
    "deviation": (("scaling", "deviation", "u"), 0.0, "must be above zero"),
    "range": (("scaling", "output_range"), [1.0], "must be two numbers"),
    "lag": (("terms", 1, "factors"), [["y", 9, 1]], "a lag outside the model"),
    "power": (("terms", 1, "factors"), [["y", 1, -1]], "must be a count"),
    "triple": (("terms", 1, "factors"), [["y", 1]], "channel, lag and power"),
    "centre": (("terms", 3, "centre"), [0.1], "a centre does not fit"),
    "term": (("terms", 1), 3, "a term must be a table"),
    "structure": (("structure", "degree"), 0, "makes no NARX model"),
    "missing": (("structure",), {"output": "y"}, "lacks keys"),
    "truth": (("structure", "linear"), 1, "must be true or false"),
    "list": (("terms",), 1, "must be a list"),
}


@pytest.mark.parametrize("case", CHANGES)
def test_narx_files_that_contradict_themselves(case: str) -> None:
    places, value, words = CHANGES[case]
    content = copy.deepcopy(model_to_description(NARX))
    item = content
    for place in places[:-1]:
        item = item[place]
    item[places[-1]] = value
    with pytest.raises(FlightidError, match=words):
        model_from_description(content)
