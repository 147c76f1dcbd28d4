"""Models of the library against published aircraft, closed-form approximations and their page."""

from __future__ import annotations

import numpy as np
import pytest
from tools.library_page import PAGE, page

import flightid as fid
from flightid.models import StateSpaceModel
from tests.closeness import assert_close

# Nelson, Flight Stability and Automatic Control, 2nd ed., ch. 4 and 5: the Navion at 176 ft/s.
LONGITUDINAL = [-2.5 + 2.59j, -0.0171 + 0.213j]
LATERAL = [-8.435, -0.487 + 2.335j, -0.00877]
# Skogestad and Postlethwaite, Multivariable Feedback Control, 2nd ed.: the Lynx in hover.
# Rows and columns: theta, phi, p, q, r, u, v, w.
LYNX = """
0 0 0 .99857378005981 .05338427424431 0 0 0
0 0 1 -.00318221934140 .05952465534210 0 0 0
0 0 -11.57049560546880 -2.54463768005371 -.06360262632370 .10678052902222 -.09491866827011 .00710757449269
0 0 .43935656547546 -1.99818229675293 0 .01665188372135 .01846204698086 -.00118747074157
0 0 -2.04089546203613 -.45899915695190 -.73502779006958 .01925575733185 -.00459562242031 .00212036073208
-32.10360717773440 0 -.50335502624512 2.29785919189453 0 -.02121581137180 -.02116791903973 .01581159234047
.10216116905212 32.05783081054690 -2.34721755981445 -.50361156463623 .83494758605957 .02122657001019 -.03787973523140 .00035400385968
-1.91097259521484 1.71382904052734 -.00400543212891 -.05741119384766 0 .01398963481188 -.00090675335377 -.29051351547241
"""  # noqa: E501
LYNX_ORDER = ["theta", "phi", "p", "q", "r", "u", "v", "w"]


def _model(name: str) -> StateSpaceModel:
    model = fid.load_model(name)
    assert isinstance(model, StateSpaceModel)
    return model


@pytest.mark.parametrize(
    ("name", "modes"),
    [
        ("fixed_wing_longitudinal", LONGITUDINAL),
        ("fixed_wing_lateral", LATERAL),
        ("fixed_wing_lateral_coefficients", LATERAL),
    ],
)
def test_the_navion_has_its_published_modes(name: str, modes: list[complex]) -> None:
    found = _model(name).eigenvalues()
    for mode in modes:
        distance = float(np.min(np.abs(found - mode)))
        assert distance <= 4e-3 * abs(mode), f"{mode}: {found}"


def test_the_coefficients_of_the_navion_make_its_modes_in_trim() -> None:
    """Printed coefficients carry the weight at 175 ft/s, not at 176: two percent in the modes."""
    model = _model("fixed_wing_longitudinal_coefficients")
    assert max(map(abs, model.residuals().values())) < 1e-3, "newtons and newton metres"
    level = model.trimmed(["V", "alpha", "theta", "thrust"], require=["theta - alpha"])
    assert_close(level.trim["V"], model.trim["V"], rtol=1e-8, why="the file states its trim")
    found = level.eigenvalues()
    for mode in LONGITUDINAL:
        distance = float(np.min(np.abs(found - mode)))
        assert distance <= 2e-2 * abs(mode), f"{mode}: {found}"


def test_the_lynx_has_its_published_matrix() -> None:
    model = _model("helicopter_6dof")
    places = [list(model.states).index(name) for name in LYNX_ORDER]
    found = model.state_space()[0][np.ix_(places, places)]
    published = np.array([[float(x) for x in row.split()] for row in LYNX.strip().splitlines()])
    assert_close(found, published, rtol=1e-4, atol=2e-5, why="six digits of values and attitudes")


def test_the_lynx_forward_of_hover_turns_with_its_speed() -> None:
    """U0 q stands in w' and -U0 r in v': what the hover matrix cannot show."""
    hover = _model("helicopter_6dof")
    forward = hover.with_fixed(U0=100.0, V0=3.0, W0=7.0)
    change = forward.matrices().f - hover.matrices().f
    names = list(hover.states)
    expected = {("u", "q"): -7.0, ("u", "r"): 3.0, ("v", "r"): -100.0, ("v", "p"): 7.0}
    expected |= {("w", "p"): -3.0, ("w", "q"): 100.0}
    entries = {(names[i], names[j]): change[i, j] for i, j in zip(*np.nonzero(change), strict=True)}
    assert entries == pytest.approx(expected)


def _oscillation(model: StateSpaceModel, near: float) -> complex:
    found = [mode for mode in model.eigenvalues() if mode.imag > 0.0]
    return complex(min(found, key=lambda mode: abs(abs(mode) - near)))


def test_short_period_is_that_of_the_full_model() -> None:
    short = complex(_model("short_period").eigenvalues()[1])
    full = _oscillation(_model("fixed_wing_longitudinal"), 3.6)
    # Nelson, eqs. 4.70 and 4.71.
    damping = 2.0767 + 0.898 + 108.6 / 53.645
    square = 2.0767 * 108.6 / 53.645 + 8.8
    assert_close(-2.0 * short.real, damping, rtol=1e-6, why="closed form of two states")
    # The derivative by the rate of alpha acts through Zalpha too: exact only with it on the left.
    assert_close(abs(short) ** 2, square, rtol=1e-6, why="closed form of two states")
    assert abs(short - full) < 0.06 * abs(full)


def test_phugoid_is_lanchesters() -> None:
    model = _model("phugoid")
    found = complex(model.eigenvalues()[1])
    assert_close(abs(found), np.sqrt(0.3697 * 9.80665 / 53.645), rtol=1e-9, why="closed form")
    assert_close(-2.0 * found.real, 0.0451, rtol=1e-9, why="closed form")
    # Lift as the square of the speed, no drag: Lanchester's frequency sqrt(2) g / U0.
    lanchester = model.with_fixed(Zu=-2.0 * 9.80665 / 53.645, Xu=0.0).eigenvalues()
    expected = np.sqrt(2.0) * 9.80665 / 53.645
    assert_close(lanchester.imag, [-expected, expected], rtol=1e-9, why="closed form")
    full = _oscillation(_model("fixed_wing_longitudinal"), 0.21)
    assert abs(abs(found) - abs(full)) < 0.25 * abs(full)


def test_dutch_roll_frequency_is_near_that_of_the_full_model() -> None:
    found = complex(_model("dutch_roll").eigenvalues()[1])
    y, n_r, n_beta = -13.642 / 53.645, -0.7605, 4.495
    assert_close(abs(found) ** 2, y * n_r + n_beta, rtol=1e-9, why="closed form of two states")
    assert_close(2.0 * found.real, y + n_r, rtol=1e-9, why="closed form of two states")
    full = _oscillation(_model("fixed_wing_lateral"), 2.4)
    assert abs(abs(found) - abs(full)) < 0.1 * abs(full)


@pytest.mark.parametrize("name", fid.library_names())
def test_every_model_names_its_source_and_explains_its_parameters(name: str) -> None:
    model = fid.load_model(name)
    assert len(model.source) > 20
    unexplained = [p.name for p in model.parameters.values() if len(p.note) < 4]
    assert not unexplained, f"parameters of {name} without a note in plain words: {unexplained}"


def test_the_page_of_the_library_is_in_step() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python tools/library_page.py --write"
