"""Noise of sensors is seldom called turbulence, whatever its colour."""

from __future__ import annotations

import pytest

from tests.strangers.counting import limits
from tests.strangers.turbulence import COLOURS, VEHICLES, calm

RUNS = 200


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", VEHICLES, ids=lambda each: each.name)
@pytest.mark.parametrize("colour", COLOURS)
def test_sensors_are_seldom_called_turbulence(vehicle, colour) -> None:
    alarms = sum(calm(seed, vehicle=vehicle, **COLOURS[colour]) for seed in range(RUNS))
    assert alarms / RUNS <= limits(RUNS, nominal=0.05)[1]
