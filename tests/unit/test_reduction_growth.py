"""A reduction keeps what grows, however little the fitted band shows of it."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light

HOVER = """
kind = "state-space"
name = "Pitch near hover"
[states]
u = "ft/s"
q = "rad/s"
theta = "rad"
[inputs]
lon = "in"
[outputs]
q = "q"
[constants]
g = { value = 32.174, unit = "ft/s^2" }
Xu = { value = -0.02, unit = "1/s" }
[parameters]
Mu = { value = 0.005, unit = "rad/(ft*s)" }
Mq = { value = -2.5, unit = "1/s" }
Mlon = { value = 0.6, unit = "rad/(in*s^2)" }
[equations]
"u'" = "Xu*u - g*theta"
"q'" = "Mu*u + Mq*q + Mlon*lon"
"theta'" = "q"
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[fid.Fit, fid.FrequencyResponse]:
    path = tmp_path_factory.mktemp("hover") / "hover.toml"
    path.write_text(HOVER)
    # The truth by NumPy, in a band above its phugoid.
    a = np.array([[-0.02, 0.0, -32.174], [0.004, -2.0, 0.0], [0.0, 1.0, 0.0]])
    omega = np.geomspace(0.8, 20.0, 40)
    curve = [np.linalg.solve(1j * w * np.eye(3) - a, [0.0, 0.5, 0.0])[1] for w in omega]
    random = np.random.default_rng(0)
    noisy = np.array(curve) * (1.0 + 0.01 * (random.standard_normal((2, 40)).T @ [1.0, 1j]))
    data = fid.FrequencyResponse.from_values(
        omega, noisy[None, None], inputs=["lon"], outputs=["q"],
        units={"lon": "in", "q": "rad/s"}, random_error=np.full((1, 1, 40), 0.01),
    )  # fmt: skip
    return fid.identify(fid.load_model(path), data, minimum_coherence=None), data


def test_a_step_that_takes_away_what_grows_is_refused(
    flown: tuple[fid.Fit, fid.FrequencyResponse],
) -> None:
    asked = {"maximum_insensitivity_percent": 1.0, "maximum_cost_rise_percent": 1e4}
    found = fid.reduce(*flown, **asked, maximum_total_cost_rise_percent=1e6, keep=["Mq", "Mlon"])
    assert not found.dropped
    assert found.path[0].changes_growth
    assert "that doubles in" in found.path[0].note
    assert found.path[0].note.endswith("would be gone")


def test_a_reduction_by_hand_says_what_it_took_away(
    flown: tuple[fid.Fit, fid.FrequencyResponse],
) -> None:
    found = fid.reduce(*flown, drop=["Mu"])
    (said,) = (each for each in found.findings if each.code == "reduction-changes-modes")
    assert said.light is Light.AMBER
    assert "doubles in" in said.message
    assert "is gone" in said.message
    assert "1 pole has come to rest" in said.message
    kept = fid.reduce(*flown, keep=["Mu", "Mq", "Mlon"])
    assert not [each for each in kept.findings if each.code == "reduction-changes-modes"]
