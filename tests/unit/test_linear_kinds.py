"""Which linear kinds a proposal tries for a rig of several inputs, and which it spares itself."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.identification.prediction_error.information_criteria import criteria
from flightid.study import kind_scans
from flightid.study.kind_scans import scan_subspace
from flightid.study.proposal.order_scans import ProposedScans
from flightid.study.proposal.structures_of import _taken, likely_delays
from flightid.validation.order_scan.result import OrderTrial

U = ("u", "v")
A = np.array([[0.85, 0.25, 0.0], [-0.25, 0.85, 0.0], [0.0, 0.0, 0.97]])
B = np.array([[0.2, 0.0], [0.1, 0.3], [0.0, 0.15]])
C = np.array([[1.0, 0.3, 1.0]])
K = np.array([[0.4], [-0.3], [0.5]])
"""Two inputs and noise that shares the poles: a state equation driven by both (SciPy)."""


def flown(seed: int, n: int = 900) -> fid.Record:
    random = np.random.default_rng(seed)
    u = np.repeat(random.standard_normal((n // 6, 2)), 6, axis=0)
    e = 0.2 * random.standard_normal((len(u), 1))
    system = (A, np.hstack([B, K]), C, np.array([[0.0, 0.0, 1.0]]), 1.0)
    _, y, _ = signal.dlsim(system, np.hstack([u, e]))
    inputs = dict(zip(U, u.T, strict=True))
    time_s = np.arange(len(u), dtype=float)
    return fid.Record.from_arrays(time_s, inputs=inputs, outputs={"y": y[:, 0]}, hold="zero")


def test_a_model_of_states_has_the_order_of_the_plant_and_is_refined(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(kind_scans, "LARGEST_ORDER", 4)
    first, second = flown(0), flown(1)
    found = scan_subspace(U, "y", 60.0, [[first]], [[second]])
    assert found is not None
    assert found.structure.order == 3
    assert found.structure.refine, "what is delivered is the refined model, with intervals"
    assert found.likelihood.bic is not None
    known = np.sort_complex(np.linalg.eigvals(found.model.matrices[0]))
    assert np.allclose(known, np.sort_complex(np.linalg.eigvals(A)), atol=0.03)
    still = flown(0).replace({"y": np.zeros(len(first.time_s))})
    with pytest.raises(fid.FlightidError):
        fid.identify(found.structure, still)
    assert scan_subspace(U, "y", 60.0, [[still]], [[second]]) is None, "no order can be fitted"


def ran(bic: float, rms: float, delay: int = 1) -> OrderTrial:
    """A trial whose free run and likelihood are given."""
    noise = np.random.default_rng(1).standard_normal(800)
    asked = fid.PolynomialModel.oe("u", "y", nb=1, nf=1, nk=delay)
    made = criteria(800.0 * float(np.exp(bic / 800.0)), 800, 0)
    errors = (rms * noise.astype(np.float32),)
    return OrderTrial(asked, None, made, rms, 90.0, errors=errors)


@pytest.mark.parametrize(
    ("reached", "kind"),
    [
        ({"armax": ran(0.0, 1.0), "oe": ran(0.0, 1.02)}, "oe"),
        ({"subspace": ran(0.0, 1.0), "bj": ran(40.0, 1.02)}, "bj"),
        ({"subspace": ran(0.0, 1.02), "bj": ran(90.0, 1.0)}, "subspace"),
        ({"subspace": ran(0.0, 2.0), "bj": ran(90.0, 1.0)}, "bj"),
        ({"armax": ran(0.0, 1.0), "bj": ran(90.0, 1.02)}, "bj"),
    ],
    ids=["least assumed", "as likely", "far likelier", "runs worse", "of polynomials as before"],
)
def test_states_stand_for_a_kind_that_runs_alike_and_is_far_less_likely(
    reached: dict[str, OrderTrial], kind: str
) -> None:
    assert _taken(reached) == kind


def test_delays_that_every_order_refutes_are_not_searched() -> None:
    trials = [ran(0.0, 1.0, 1), ran(300.0, 1.0, 1), ran(45.0, 0.9, 2), ran(120.0, 0.5, 3)]
    assert likely_delays(SimpleNamespace(trials=trials)) == (1, 2)


@pytest.mark.parametrize(("rough", "fits"), [(1.3, 1), (1.2, 2)], ids=["far", "near"])
def test_a_joint_estimate_that_runs_far_worse_is_not_refined(
    monkeypatch: pytest.MonkeyPatch, rough: float, fits: int
) -> None:
    asked: list[object] = []

    def joint(_: object, settings: object, *__: object) -> dict[str, float]:
        asked.append(settings.options.get("refine", True))
        return {"p": 1.0, "q": rough if len(asked) == 1 else 1.0}

    monkeypatch.setattr(ProposedScans, "_joint", joint)
    scans = ProposedScans(None, None, U, ("p", "q"), (), None)
    found = scans.subspace_errors(("p", "q"), U, 1.0, {"p": 1.0, "q": 1.0})
    assert asked == [False, True][:fits]
    assert found == {"p": 1.0, "q": rough if fits == 1 else 1.0}
