"""A flown session identifies back to the vehicle: intervals counted over many flights."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

pytest.importorskip("fastapi", reason="the extra app is not installed")

import flightid as fid
from flightid.app.fly_loop import FlySwitches, PilotedVehicle
from flightid.app.fly_vehicles import RATE_HZ, fly_vehicle
from flightid.excitation.sweep import sweep

AH64 = fly_vehicle("ah64_hover")
FREE = ("Mq", "Mlon", "Lp", "Llat")
FLIGHT_S = 40.0
RUNS = 20


def flown(seed: int) -> fid.Record:
    """A sweep of pitch, then one of roll, under the law, by the loop of the page."""
    loop = PilotedVehicle(AH64, 1.0 / RATE_HZ, switches=FlySwitches(), seed=seed)
    rows: dict[str, list[float]] = {name: [] for name in (*loop.inputs, *loop.outputs)}
    for k in range(round(FLIGHT_S * RATE_HZ)):
        for start, name in ((50, "lon"), (2000, "lat")):
            if k == start:
                loop.sweep(sweep(
                    band_rad_s=(1.0, 12.0), amplitude=0.4, duration_s=18.0,
                    sample_rate_hz=RATE_HZ, name=name, unit="in", hold_cycles=1.0,
                ))  # fmt: skip
        for name, value in (loop.step({}) | loop.driven).items():
            rows[name].append(value)
    return fid.Record.from_arrays(
        np.arange(len(rows["q"])) / RATE_HZ,
        inputs={name: rows[name] for name in loop.inputs},
        outputs={name: rows[name] for name in loop.outputs},
        units={name: str(unit) for name, unit in AH64.model.units.items() if name in rows},
        hold="zero",
    )


def identified(seed: int) -> list[tuple[float, float]]:
    """Error and half width of each interval."""
    model = AH64.model
    truth = {
        name: float(each.value) for name, each in model.parameters.items() if each.value is not None
    }
    fixed = {name: value for name, value in truth.items() if name not in FREE}
    start = model.with_fixed(**fixed).with_values({name: 0.8 * truth[name] for name in FREE})
    fit = fid.identify(start, flown(seed))
    found = []
    for name in FREE:
        ends, value = fit.parameters[name].interval95, fit.parameters[name].value
        assert ends is not None
        assert value is not None
        found.append((value - truth[name], 0.5 * (ends[1] - ends[0])))
    return found


@pytest.mark.nightly
def test_flown_sweeps_identify_back_within_their_intervals() -> None:
    """20 flights of four derivatives; the count of a fair coin of 0.95 lies in its 99.9 %."""
    rows = np.array([identified(seed) for seed in range(RUNS)])
    hits = int((np.abs(rows[..., 0]) <= rows[..., 1]).sum())
    low, high = stats.binom.interval(0.999, RUNS * len(FREE), 0.95)
    assert low <= hits <= high, hits
    z = rows[..., 0] / rows[..., 1] * 1.96
    assert 0.7 < float(np.sqrt((z**2).mean())) < 1.35
    assert np.abs(rows[..., 1]).max() < 0.1
