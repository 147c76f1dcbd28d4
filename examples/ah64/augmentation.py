"""An augmentation of limited authority closed around model and vehicle, and taken out of flights.

Each axis adds washed-out rate feedback and a share of the high-passed stick, within a tenth of the
actuator's travel: that form is the paper's. Attitude feedback, against a hovering vehicle's slow
oscillation, and all numbers are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flights import AMPLITUDES_IN, INPUTS, SAMPLE_RATE_HZ, truth

import flightid as fid
from flightid.errors import FlightidError
from flightid.excitation import doublet
from flightid.table import Column


@dataclass(frozen=True)
class Axis:
    """One axis of the augmentation.

    Attributes
    ----------
    rate, attitude : str
        What it feeds back, and what the pilot sees.
    gain_in_s : float
        Stick inches for a rad/s.
    hold_in : float
        Stick inches for a rad of attitude.
    ahead : float
        Inches for an inch of high-passed stick.
    travel_in : float
        Half of the actuator's travel, inches of stick.
    """

    rate: str
    attitude: str
    gain_in_s: float
    hold_in: float
    ahead: float
    travel_in: float


AXES = {
    "lon": Axis("q", "theta", 3.0, 4.0, 0.25, 5.0),
    "lat": Axis("p", "phi", 1.2, 2.0, 0.25, 4.5),
    "ped": Axis("r", "r", 2.0, 0.0, 0.15, 3.0),
}
AUTHORITY = 0.1
RATE_WASHOUT_RAD_S, STICK_WASHOUT_RAD_S = 0.25, 1.0
SENSOR_RAD_S, DELAY_S = 60.0, 0.02
NOISE_RAD_S = 0.002
LENGTH_S = 14.0
BAND_RAD_S = (0.8, 60.0)
"""Above the slow modes, which the pilot holds."""


def augmentation(*, hold: bool = True, noisy: bool = False) -> list[fid.loops.Block]:
    """Sensor, washouts, gains, limit and computation delay of the three axes.

    Parameters
    ----------
    hold : bool
        With attitude feedback.
    noisy : bool
        Sensors with noise, which comes from outside as ``"<rate>_noise"`` and is logged.
    """
    make, blocks = fid.loops, []
    for stick, axis in AXES.items():
        rate, law = axis.rate, f"{stick}_law"
        read = [f"{rate}_washed", f"{stick}_washed"]
        gains = [-axis.gain_in_s, axis.ahead]
        if hold and axis.hold_in:
            read.append(axis.attitude)
            gains.append(-axis.hold_in)
        seen = f"{rate}_seen" if noisy else rate
        if noisy:
            blocks.append(make.sum_of(seen, rate, f"{rate}_noise"))
        blocks += [
            make.low_pass(seen, f"{rate}_gyro", SENSOR_RAD_S),
            make.washout(f"{rate}_gyro", f"{rate}_washed", RATE_WASHOUT_RAD_S),
            make.washout(stick, f"{stick}_washed", STICK_WASHOUT_RAD_S),
            make.gain(read, law, [gains], units={f"{rate}_washed": "rad/s", law: "in"}),
            make.delay(law, f"{law}_late", DELAY_S),
            make.limiter(f"{law}_late", stick, AUTHORITY * axis.travel_in),
        ]
    return blocks


@dataclass(frozen=True)
class Augmented:
    """What the augmentation does.

    Attributes
    ----------
    flights : Table
        Vehicle beside model through the same doublets.
    theil : dict of str to float
        By ``"rate/stick"``.
    rates : ClosedLoop
        Around the identified model, without attitude feedback.
    closed : ClosedLoop
        The whole augmentation around the identified model.
    margins : Table
        Loops broken at the actuators, the others closed.
    bandwidth : Table
        With the augmentation off and on.
    opened : Verification
        The bare model on the augmented flights, the augmentation taken out of them.
    """

    flights: fid.Table
    theil: dict[str, float]
    rates: fid.ClosedLoop
    closed: fid.ClosedLoop
    margins: fid.Table
    bandwidth: fid.Table
    opened: fid.Verification


def augment(fit: fid.Fit) -> Augmented:
    """Close the augmentation around the identified model and hold it against augmented flights.

    Parameters
    ----------
    fit : Fit
        Of the bare vehicle.

    Returns
    -------
    Augmented
    """
    rates = fid.close_loop(fit.model, augmentation(hold=False), name="AH-64 with rate feedback")
    closed = fid.close_loop(fit, augmentation(), name="AH-64 with augmentation", draws=20)
    vehicle = fid.close_loop(truth(), augmentation(noisy=True), draws=0).loops
    flown = {stick: _fly(vehicle, stick, seed) for seed, stick in enumerate(AXES)}
    table, theil = _beside(closed.loops, flown)
    verified = fid.verify(
        fit,
        [fid.open_loop(record, augmentation()) for record in flown.values()],
        outputs=tuple(axis.rate for axis in AXES.values()),
    )
    assert isinstance(verified, fid.Verification)
    marked, bands = _margins(closed), _bandwidths(fit, closed)
    return Augmented(table, theil, rates, closed, marked, bands, verified)


def _sticks(moved: str, noise: float = 0.0, seed: int = 0) -> fid.Record:
    shape = doublet(
        amplitude=AMPLITUDES_IN[moved],
        step_s=1.0,
        sample_rate_hz=SAMPLE_RATE_HZ,
        lead_s=0.5,
        tail_s=LENGTH_S - 2.5,
        name=moved,
        unit="in",
    )
    random, n = np.random.default_rng(seed), shape.n_samples
    hands = {name: np.zeros(n) for name in INPUTS} | dict(shape.by_name)
    gyros = {f"{axis.rate}_noise": noise * random.standard_normal(n) for axis in AXES.values()}
    units = dict.fromkeys(INPUTS, "in") | dict.fromkeys(gyros, "rad/s")
    return fid.Record.from_arrays(
        shape.time_s, inputs={**hands, **gyros}, units=units, name=f"doublet of {moved}"
    )


def _fly(loops: fid.Interconnection, stick: str, seed: int) -> fid.Record:
    """What a log holds of an augmented flight: sticks and noisy rates."""
    seen = [*(f"{axis.rate}_seen" for axis in AXES.values()), "phi", "theta"]
    flown = loops.simulate(_sticks(stick, NOISE_RAD_S, 7 + seed), outputs=seen)
    return fid.Record.from_arrays(
        flown.time_s,
        inputs={name: flown[name] for name in INPUTS},
        outputs={
            **{axis.rate: flown[f"{axis.rate}_seen"] for axis in AXES.values()},
            **{name: flown[name] for name in ("phi", "theta")},
        },
        units={name: truth().units[name] for name in (*INPUTS, "p", "q", "r", "phi", "theta")},
        name=f"augmented doublet of {stick}",
    )


def _beside(
    loops: fid.Interconnection, flown: dict[str, fid.Record]
) -> tuple[fid.Table, dict[str, float]]:
    theil, rows = {}, []
    for stick, record in flown.items():
        axis = AXES[stick]
        ours = loops.simulate(record, outputs=[axis.rate, f"{stick}_controller"])
        found = float(fid.validation.theil(record[axis.rate], ours[axis.rate]))
        theil[f"{axis.rate}/{stick}"] = found
        share = np.abs(ours[f"{stick}_controller"]) >= AUTHORITY * axis.travel_in * (1 - 1e-9)
        peaks = (float(np.max(np.abs(each[axis.rate]))) for each in (ours, record))
        rows.append((stick, axis.rate, *peaks, 100.0 * float(np.mean(share)), found))
    columns = (
        Column("stick"),
        Column("rate"),
        Column("peak, model", "rad/s", 3),
        Column("peak, vehicle", "rad/s", 3),
        Column("at its limit", "% of the time", 2),
        Column("Theil coefficient", digits=3),
    )
    title = "Doublets with the augmentation on: model beside vehicle"
    return fid.Table(title, columns, tuple(rows)), theil


def _margins(closed: fid.ClosedLoop) -> fid.Table:
    rows = []
    for stick, found in closed.margins(band_rad_s=(0.02, 100.0)).items():
        wanted = (found.crossover, found.phase_margin, found.gain_margin, found.delay_margin)
        rows.append((f"at {stick}", *(each.text for each in wanted)))
    columns = tuple(
        Column(name)
        for name in ("loop broken", "crossover", "phase margin", "gain margin", "delay margin")
    )
    return fid.Table("Margins of the augmentation, 95 % intervals", columns, tuple(rows))


def _bandwidths(fit: fid.Fit, closed: fid.ClosedLoop) -> fid.Table:
    rows = []
    for stick, axis in AXES.items():
        kind = "rate" if axis.attitude == axis.rate else "attitude"
        for name, source in (("off", fit), ("on", closed.uncertain)):
            try:
                found = fid.attitude_bandwidth(
                    source, stick, axis.attitude, output_is=kind, band_rad_s=BAND_RAD_S
                )
            except FlightidError as error:
                # An unstable vehicle has no bandwidth: its phase begins below -135 degrees.
                rows.append((f"{axis.attitude}/{stick}", name, None, None, error.problem))
                continue
            numbers = (found.bandwidth.text, found.quantities[5 if found.nonlinear else 4].text)
            rows.append((f"{axis.attitude}/{stick}", name, *numbers, ""))
    columns = tuple(
        Column(name) for name in ("response", "augmentation", "bandwidth", "phase delay", "note")
    )
    table = fid.Table("Bandwidth and phase delay, 95 % intervals", columns, tuple(rows))
    return table.without_empty_columns()


def tables_of(found: Augmented) -> tuple[fid.Table, ...]:
    """What is printed and reported."""
    return (
        found.rates.summary(),
        found.closed.summary(),
        found.margins,
        found.bandwidth,
        found.flights,
        found.opened.summary(),
    )
