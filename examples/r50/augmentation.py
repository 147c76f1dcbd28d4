"""A digital augmentation closed around the identified R-50, with its margins.

Run: python examples/r50/augmentation.py [short|full] [seed]

The controller runs at 50 Hz: it samples what it reads, computes for 10 ms and holds its
commands; the servos that the records had taken out stand in the loop again.
"""

from __future__ import annotations

import sys

import flights
import identification

import flightid as fid
from flightid.errors import FlightidError
from flightid.table import Column

SAMPLE_S, COMPUTATION_S = 0.02, 0.01
GAINS = {
    "lat": ("p", "phi", "vm", 0.03, 1.5, 0.015),
    "lon": ("q", "theta", "um", -0.03, -1.5, 0.015),
}
"""Rate, attitude, speed; stick for a rad/s, a rad, a ft/s. Positive lon pitches the nose down."""


def augmentation() -> list[fid.loops.Block]:
    """Digital laws of both axes, with the servos behind them."""
    make, blocks = fid.loops, []
    for stick, (*read, by_rate, by_attitude, by_speed) in GAINS.items():
        law = f"{stick}_law"
        gains = [[-by_rate, -by_attitude, -by_speed]]
        blocks += [
            make.gain(read, law, gains),
            make.sample_and_hold(law, f"{stick}_held", SAMPLE_S, COMPUTATION_S),
            make.low_pass(f"{stick}_held", stick, flights.SERVOS[stick]),
        ]
    return blocks


def main(form: str = "short", seed: str = "0") -> None:
    """Identify, close, and print poles, margins and bandwidths."""
    if form not in ("short", "full"):
        sys.exit(__doc__)
    plan = flights.plan("hover", full=form == "full")
    found = identification.identify(
        plan, identification.estimate(plan, plan.sweeps(int(seed))), reduced=form == "full"
    )
    closed = fid.close_loop(found.fit, augmentation(), draws=20, name="R-50 with augmentation")
    print(closed.summary(), end="\n\n")
    print(margins(closed), end="\n\n")
    print(bandwidths(found.fit, closed))


def margins(closed: fid.ClosedLoop) -> fid.Table:
    """Of the loops broken at the actuators, the other closed."""
    rows = []
    for stick, found in closed.margins(band_rad_s=(0.02, 100.0)).items():
        numbers = (found.crossover, found.phase_margin, found.gain_margin, found.delay_margin)
        rows.append((f"at {stick}", *(each.text for each in numbers)))
    names = ("loop broken", "crossover", "phase margin", "gain margin", "delay margin")
    columns = tuple(map(Column, names))
    return fid.Table("Margins of the augmentation, 95 % intervals", columns, tuple(rows))


def bandwidths(fit: fid.Fit, closed: fid.ClosedLoop) -> fid.Table:
    """Attitude bandwidth to the stick, augmentation off and on."""
    rows = []
    for stick, (_, attitude, _, _, gain, _) in GAINS.items():
        for name, source in (("off", fit), ("on", closed.uncertain)):
            try:
                band = fid.attitude_bandwidth(
                    source, stick, attitude, band_rad_s=(0.5, 60.0), sign=1 if gain > 0 else -1
                )
            except FlightidError as error:
                rows.append((f"{attitude}/{stick}", name, None, None, error.problem))
                continue
            late = band.quantities[5 if band.nonlinear else 4]
            rows.append((f"{attitude}/{stick}", name, band.bandwidth.text, late.text, ""))
    names = ("response", "augmentation", "bandwidth", "phase delay", "note")
    columns = tuple(map(Column, names))
    title = "Bandwidth and phase delay, 95 % intervals"
    return fid.Table(title, columns, tuple(rows)).without_empty_columns()


if __name__ == "__main__":
    main(*sys.argv[1:])
