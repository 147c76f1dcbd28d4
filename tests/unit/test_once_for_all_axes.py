"""What several axes ask of the same vehicles is made once."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

import flightid as fid
from flightid.control.loops import interconnection
from flightid.control.loops.delayed_roots import newton_roots, refined_roots
from flightid.dynamics.handling_qualities import handling_qualities as module


def delayed_loop() -> fid.Interconnection:
    return fid.connect(
        [
            fid.loops.sum_of("e", "r", "-y"),
            fid.loops.transfer("e", "y", [3.0], [1.0, 1.0], delay_s=0.1),
        ],
        inputs=["r"],
        outputs=["y"],
    )


def test_a_loop_makes_its_linear_system_once(monkeypatch: pytest.MonkeyPatch) -> None:
    loop, made = delayed_loop(), []
    whole = interconnection.continuous_system

    def counted(*given: object) -> object:
        made.append(given)
        return whole(*given)

    monkeypatch.setattr(interconnection, "continuous_system", counted)
    first = loop.linear_system()
    assert loop.linear_system() is first
    assert loop.linear_system(4) is not first
    assert len(made) == 2


def test_roots_found_together_are_those_found_one_by_one() -> None:
    # x' = -k x(t - τ): roots of s + k e^(-s τ), by Lambert's function.
    k, tau = 2.0, 0.4
    parts = (np.zeros((1, 1)), -k * np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
    known = np.array([scipy.special.lambertw(-k * tau, n) / tau for n in (0, -1, 1, -2)])
    seeds = known * 1.1 + 0.05
    found = newton_roots(*parts, np.array([tau]), seeds)
    alone = [newton_roots(*parts, np.array([tau]), seeds[n : n + 1])[0] for n in range(4)]
    assert found == alone
    for root in found:
        assert root is not None
        assert np.abs(root + k * np.exp(-root * tau)) < 1e-10
    roots = refined_roots(*parts, np.array([tau]), known[:2] + 0.01)
    np.testing.assert_allclose(sorted(roots.imag), sorted([known[0].imag, -known[0].imag]))


def test_a_root_among_the_seeds_leaves_the_others_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A pole of its own at −1 makes F singular at its seed; 30 others go on side by side."""
    a, b, c = np.diag([0.0, -1.0]), np.array([[-3.0], [0.0]]), np.array([[1.0, 0.0]])
    parts = (a, b, c, np.zeros((1, 1)), np.array([0.4]))
    others = [complex(-1.0 - k, 4.0 * k) for k in range(1, 31)]
    alone = newton_roots(*parts, np.array(others))
    solved: list[int] = []
    solve = np.linalg.solve

    def counted(f: np.ndarray, right: np.ndarray) -> np.ndarray:
        solved.append(len(f))
        return np.asarray(solve(f, right))

    monkeypatch.setattr(np.linalg, "solve", counted)
    assert newton_roots(*parts, np.array([-1.0 + 0.0j, *others])) == [-1.0 + 0.0j, *alone]
    assert solved[:2] == [31, 30]
    solved.clear()  # below the real axis steps mirror those above
    found = newton_roots(*parts, np.array([*np.conj(others), *others]))
    assert found == [*(each and each.conjugate() for each in alone), *alone]
    assert solved[0] == 30


def test_roots_with_a_direct_part_solve_their_equation() -> None:
    a, b, c, d = (np.array([[each]]) for each in (-1.0, 1.0, 2.0, 0.3))
    tau = 0.2
    found = newton_roots(a, b, c, d, np.array([tau]), np.array([0.5 + 1.0j, -3.0 + 12.0j]))
    assert all(each is not None for each in found)
    for s in found:
        assert s is not None
        late = np.exp(-s * tau)
        assert abs(s + 1.0 - late / (1.0 - 0.3 * late) * 2.0) < 1e-10


def test_a_rating_makes_each_vehicle_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    whole = module.linear_system

    def counted(model: object) -> object:
        asked.append(model)
        return whole(model)

    monkeypatch.setattr(module, "linear_system", counted)
    model = fid.load_model("r50_hover")
    found = fid.handling_qualities(
        model, axes={"roll": ("p", "lat"), "pitch": ("q", "lon")}, signs={"roll": 1, "pitch": 1}
    )
    assert set(found.bandwidths) <= {"roll", "pitch"}
    assert len(asked) <= 2  # the bandwidths' vehicle, and that of the modes
