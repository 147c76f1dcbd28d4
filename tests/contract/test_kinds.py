"""Every verb that takes a fit or a model answers for every kind, or refuses it with the reason."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flightid as fid
from flightid.errors import FlightidError
from flightid.identification import uncertain_of
from flightid.models import Model
from flightid.models.kinds import KINDS

T_S = 0.05
TIME_S = np.arange(300) * T_S
RANDOM = np.random.default_rng(0)
INPUT = 0.3 * np.sign(np.sin(0.4 * TIME_S**1.3)) + 0.05 * RANDOM.standard_normal(300)
UNITS = {"tau_phi": "1", "p": "rad/s"}
ROLL = fid.load_model("rate_first_order").with_values({"Lp": -4.0, "Ltphi": 60.0})


def _equations(right: str) -> fid.StateSpaceModel:
    return fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"tau_phi": "1"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": right},
        parameters=fid.Parameters(
            [
                fid.Parameter("Lp", -4.0, "1/s", minimum=-60.0, maximum=0.0),
                fid.Parameter("Ltphi", 60.0, "rad/s^2"),
                fid.Parameter("p0", 30.0, "rad/s", free=False),
            ]
        ),
        name="roll",
    )


STRUCTURES = {
    "grey linear": lambda: _equations("Lp*p + Ltphi*tau_phi"),
    "grey nonlinear": lambda: _equations("Lp*p*(1 + (p/p0)^2) + Ltphi*tau_phi"),
    "transfer": lambda: ROLL,
    "ARX": lambda: fid.PolynomialModel.arx("tau_phi", "p", na=2, nb=2),
    "OE": lambda: fid.PolynomialModel.oe("tau_phi", "p", nb=2, nf=1),
    "BJ": lambda: fid.PolynomialModel.bj("tau_phi", "p", nb=2, nc=1, nd=1, nf=2),
    "innovations": lambda: fid.InnovationsModel.subspace("tau_phi", "p", 2),
    "NARX": lambda: fid.NarxStructure(("tau_phi",), "p", 1, 2, kernel=None, degree=2, stop="bic"),
}


@cache
def record() -> fid.Record:
    bare = fid.Record.from_arrays(
        TIME_S, inputs={"tau_phi": INPUT}, outputs={"p": np.zeros(300)}, units=UNITS
    )
    flown = fid.simulate(ROLL, bare)["p"]
    return bare.replace({"p": flown + 0.05 * RANDOM.standard_normal(300)})


@cache
def fit(kind: str) -> fid.Fit:
    return fid.identify(STRUCTURES[kind](), record(), loop="open")


GREY = ("grey linear", "grey nonlinear", "transfer")
SAMPLED = ("ARX", "OE", "BJ", "innovations", "NARX")
MATRICES = ("LinearSystem", "sampled LinearSystem")
FITS = tuple(f"fit of {kind}" for kind in STRUCTURES)
MODELS = tuple(f"{kind} model" for kind in STRUCTURES)
NARX = ("fit of NARX", "NARX model")


def source(name: str) -> object:
    """A fit, its model, or a linear system, by its name in the table."""
    if name in MATRICES:
        continuous = ROLL.linear_system()
        return continuous if name == MATRICES[0] else continuous.sampled(T_S)
    kind = name.removeprefix("fit of ").removesuffix(" model")
    return fit(kind) if name.startswith("fit of ") else fit(kind).model


def both(kinds: Iterable[str]) -> tuple[str, ...]:
    """Fits and models of some kinds."""
    return tuple(name for kind in kinds for name in (f"fit of {kind}", f"{kind} model"))


# Verb -> how it is called, and what it refuses because it makes no sense there.
VERBS: dict[str, tuple[Callable[[Any, Path], object], tuple[str, ...]]] = {
    "predict": (lambda it, _: fid.predict(it, record()), ()),
    "predict ahead": (lambda it, _: fid.predict(it, record(), 3), (*both(GREY), "LinearSystem")),
    "simulate": (lambda it, _: fid.simulate(it, record()), ()),
    "verify": (lambda it, _: fid.verify(it, record()), ()),
    "compare": (lambda it, _: fid.verify([it, ROLL], record(), names=["it", "roll"]), ()),
    "residual_tests": (lambda it, _: fid.residual_tests(it), (*MODELS, *MATRICES)),
    "modes": (lambda it, _: fid.modes(it), NARX),
    "margins": (lambda it, _: fid.margins(it), NARX),
    "handling_qualities": (lambda it, _: fid.handling_qualities(it), NARX),
    "interpret": (lambda it, _: fid.interpret(it), (*both(GREY), *NARX, *MATRICES)),
    "derivatives": (lambda it, _: fid.derivatives(it), (*both(("transfer", *SAMPLED)), *MATRICES)),
    "reduce": (
        lambda it, _: fid.reduce(it, record()),
        (*(name for name in FITS if name.endswith(SAMPLED)), *MODELS, *MATRICES),
    ),
    "write_model": (lambda it, path: fid.load_model(fid.write_model(it, path / "x.toml")), ()),
    "export toml": (lambda it, path: fid.export(it, path / "x.toml"), ()),
    "export mat": (lambda it, path: fid.export(it, path / "x.mat"), NARX),
    "export c": (lambda it, path: fid.export(it, path / "x.c", sample_time_s=T_S), ()),
    "to_control": (lambda it, _: fid.to_control(it, pade_order=2), NARX),
}


@pytest.mark.parametrize("verb", VERBS)
def test_every_kind_answers_or_is_refused_with_the_reason(verb: str, tmp_path: Path) -> None:
    call, refused = VERBS[verb]
    offenders = []
    for name in (*FITS, *MODELS, *MATRICES):
        it = source(name)
        try:
            found = call(it, tmp_path)
        except FlightidError as refusal:
            reason = refusal.needed is not None or refusal.action is not None
            if name not in refused or not reason:
                offenders.append(f"{name}: refused: {refusal}")
        except Exception as error:
            offenders.append(f"{name}: {type(error).__name__}: {error}")
        else:
            if found is None or name in refused:
                offenders.append(f"{name}: answered by {found!r}")
    assert not offenders, "\n".join(offenders)


def test_every_model_holds_the_protocol() -> None:
    for name in (*MODELS, *MATRICES):
        model = source(name)
        assert isinstance(model, Model), name
        assert model.to_dict()["kind"] in KINDS, name
        assert set(model.units) >= {"tau_phi", "p"}, name
        values = {key: item.value for key, item in model.parameters.items() if not item.tie}
        again = model.with_values(values)
        assert again.to_dict() == model.to_dict(), name


def test_every_fit_says_the_same_of_itself() -> None:
    for name in FITS:
        made = source(name)
        assert set(made.parameters) == set(made.model.parameters), name
        assert made.costs.keys() == {"p"}, name
        assert [left.n_samples <= 300 for left in made.residuals] == [True], name
        assert made.training["p"].unit == "rad/s", name
        assert made.minima[0].values.keys() <= made.parameters.keys(), name
        assert made.method in made.to_dict()["method"], name
        assert json.loads(json.dumps(made.to_dict()))["schema"] == "flightid.fit/1", name
        if made.covariance is not None:
            assert made.covariance.shape == made.correlation.shape == (len(made.names),) * 2, name
            assert np.array_equal(uncertain_of(made).covariance, made.carried), name
