"""Disk margins of short records: what windows blur is no part of them."""

from __future__ import annotations

import numpy as np

import flightid as fid
from tests.strangers import response_readings as readings
from tests.strangers.responses import STEP_S, held, sweep


def test_the_disk_is_least_where_it_is_in_the_vehicle_not_where_windows_move_it() -> None:
    omega = np.geomspace(*readings.BAND, 3000)
    exact = fid.FrequencyResponse.from_values(
        omega, readings.exact(omega, light=True), inputs=["u"], outputs=["p"]
    )
    u = sweep(3000, 0.6, 28.0)
    record = fid.Record.from_arrays(
        np.arange(3000) * STEP_S,
        inputs={"u": u},
        outputs={"p": held(*readings.vehicle(light=True), u)[0]},
        units={"u": "1", "p": "rad/s"},
        hold="zero",
    )
    response = fid.estimate_response(record, band_rad_s=readings.BAND, n_omega=80)
    truth, found = (
        fid.disk_margin(each, controller=lambda s: 0.25 * readings.controller(s))
        for each in (exact, response)
    )
    assert abs(found.frequency.value / truth.frequency.value - 1.0) < 2e-3
    assert abs(found.alpha.value / truth.alpha.value - 1.0) < 2e-3
