"""Gains for plants that resonate, whose noise has poles of its own."""

from __future__ import annotations

import numpy as np

import flightid as fid
from flightid.control.tuning.sampled_plants import loop_grid, sample_plants
from tests.closeness import assert_close

STEP_S = 0.1


def test_poles_of_the_noise_are_no_poles_of_the_plant() -> None:
    """The noise of a Box-Jenkins model may wander off; what its input moves does not."""
    model = fid.PolynomialModel(
        ("u",), "y", STEP_S, b=[[0.5]], f=[[1.0, -0.8]], c=[1.0, 0.2], d=[1.0, -1.1]
    )
    assert_close(model.linear_system().poles(), [0.8], rtol=1e-12, why="of F alone")
    omega = np.array([0.3, 3.0])
    assert_close(
        model.linear_system().frequency_response(omega),
        model.frequency_response(omega),
        rtol=1e-12,
        why="the same response",
    )
    options = fid.ControllerOptions(controller="pi")
    design = fid.tune_controller(model, nominal=True, band_rad_s=(0.1, 10.0), controller=options)
    assert design.exists


def test_the_grid_is_fine_where_a_plant_resonates() -> None:
    """A mode of 0.2 % damping is narrower than the even grid's steps."""
    peak_rad_s, damping = 3.0, 0.002
    a = [[0.0, 1.0], [-(peak_rad_s**2), -2.0 * damping * peak_rad_s]]
    mode = fid.LinearSystem(a, [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], ("u",), ("y",))
    plants = sample_plants([mode], ["y"], ["u"], STEP_S, hold_in_model=False)
    even, fine = (loop_grid(STEP_S, 200, each) for each in (None, plants.resonances()))
    heights = [np.abs(mode.frequency_response(each)).max() for each in (even, fine)]
    summit = 1.0 / (2.0 * damping * peak_rad_s**2)
    assert heights[0] < 0.5 * summit
    assert_close(heights[1], summit, rtol=1e-3, why="a point lies on the peak")
    assert np.all(np.diff(fine) > 0.0)
    assert set(even) <= set(fine)
