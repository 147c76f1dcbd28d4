"""Edges of a pilot's doublets called spikes, and spikes that are missed, in simulated flights.

Vehicles with half to one and a half of the usual motor lag, doublets of 0.3 to 2 s on any axis,
logged at 400 to 25 Hz; beside each healthy flight three with one to three spikes of one or two
samples in a channel, 1 to 40 times as far as it goes by itself.

Run: python -m tests.strangers.lone_samples [FLIGHTS]
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from flightid.record import Record
from flightid.record.checks import record_findings
from flightid.vehicles import PilotDoublet, QuadrotorParameters, fly

LOOPS = (1, 2, 4, 8, 16)
"""Loops of 400 Hz between rows of the log."""
END = 20
"""Samples at either end that are left alone."""
Groups = dict[str, dict[str, np.ndarray]]


def flown(random: np.random.Generator, log_every: int, seed: int) -> Record:
    """One flight with a doublet."""
    usual = QuadrotorParameters()
    vehicle = replace(
        usual,
        maximum_thrust_n=usual.maximum_thrust_n * random.uniform(0.9, 1.15),
        motor_lag_s=usual.motor_lag_s * random.uniform(0.5, 1.5),
    )
    doublet = PilotDoublet(
        ("roll", "pitch", "yaw")[random.choice(3, p=[0.7, 0.15, 0.15])],
        start_s=random.uniform(1.5, 3.0),
        amplitude=random.uniform(0.03, 0.6),
        width_s=random.uniform(0.3, 2.0),
    )
    return fly(
        duration_s=random.uniform(6.0, 14.0),
        doublets=[doublet],
        vehicle=vehicle,
        log_every=log_every,
        seed=seed,
    ).record()


def of_channels(record: Record, name: str = "", samples: np.ndarray | None = None) -> Record:
    """The same samples, but for one channel, as a record that was never examined."""
    groups: dict[str, Any] = {
        group: {each: record[each] if each != name else samples for each in names}
        for group, names in (("inputs", record.inputs), ("outputs", record.outputs))
    }
    return Record.from_arrays(record.time_s, **groups)


def spiked(random: np.random.Generator, record: Record) -> tuple[str, Record] | None:
    """A channel with spikes; None where the channel never moves."""
    name = str(random.choice([*record.inputs, *record.outputs]))
    samples = np.array(record[name])
    reach = float(np.ptp(samples))
    if reach == 0.0:
        return None
    width, count = int(random.integers(1, 3)), int(random.integers(1, 4))
    height = reach * float(np.exp(random.uniform(0.0, np.log(40.0))))
    for place in random.integers(END, samples.size - END, count):
        moved = height * random.uniform(0.5, 1.5) * random.choice([-1, 1])
        samples[place : place + width] = samples[place] + moved
    return name, of_channels(record, name, samples)


def flagged(record: Record) -> Iterator[str]:
    """Channels that are said to hold spikes."""
    for name in (*record.inputs, *record.outputs):
        if any(found.code == "spikes" for found in record_findings(record, [name])):
            yield name


def main(flights: int) -> None:
    """Count over flights, by rate of the log."""
    counts: dict[int, Counter[str]] = {loops: Counter() for loops in LOOPS}
    for seed in range(flights):
        loops = LOOPS[seed % len(LOOPS)]
        random, count = np.random.default_rng(seed), counts[loops]
        record = of_channels(flown(random, loops, seed))
        count["flights"] += 1
        count["false"] += any(flagged(record))
        for _ in range(3):
            made = spiked(random, record)
            if made is not None:
                count["spiked"] += 1
                count["found"] += made[0] in flagged(made[1])
    for loops, count in counts.items():
        sys.stdout.write(
            f"{400 / loops:4.0f} Hz: {count['false']} of {count['flights']} healthy flights said "
            f"to have spikes; {count['found']} of {count['spiked']} spiked channels found\n"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 500)
