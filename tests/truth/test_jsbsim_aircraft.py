"""What counts as truth of the JSBSim flights: its slopes at trim, run by SciPy, fly as it does."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import StateSpace, lsim

from tests.strangers import jsbsim_aircraft as aircraft

MISFIT = 0.03
"""Share of each state's deviation: bank and pitch turn the axes, to second order in the angles."""


def test_slopes_at_trim_fly_as_jsbsim_does() -> None:
    pytest.importorskip("jsbsim")
    found = aircraft.slopes()
    a, b = (
        np.array([[found[row, column] for column in columns] for row in aircraft.STATES])
        for columns in (aircraft.STATES, (*aircraft.SURFACES, "V"))
    )
    u, y = aircraft.flown()
    t = np.arange(u.shape[1]) * aircraft.STEP_S
    linear = StateSpace(a, b, np.eye(len(a)), np.zeros(b.shape))
    _, _, told = lsim(linear, u.T, t, interp=True)
    assert np.all(np.std(y - told.T, axis=1) < MISFIT * np.std(y, axis=1))
