"""The table that counts: what was promised, and what flew."""

from __future__ import annotations

from collections.abc import Mapping

import flightid as fid
from flightid.table import Cell, Column, Table

QUANTITIES = {
    "crossover": ("crossover", "rad/s"),
    "phase margin": ("phase_margin", "deg"),
    "gain margin": ("gain_margin", "dB"),
    "delay margin": ("delay_margin", "s"),
    "sensitivity peak": ("sensitivity_peak", "1"),
}


def promised_and_flown(
    tuning: fid.Tuning, measured: Mapping[str, Mapping[str, fid.Margins]]
) -> Table:
    """Margins promised from the first flight beside those measured with the new gains."""
    rows: list[tuple[Cell, ...]] = []
    for axis, loops in measured.items():
        for loop, found in loops.items():
            for name, (attribute, unit) in QUANTITIES.items():
                promise, seen = tuning[axis].promise(loop, name), getattr(found, attribute)
                low, high = promise.estimate.interval95 or (None, None)
                least, most = seen.interval95 or (None, None)
                agree = (
                    None
                    if None in (low, high, least, most)
                    else bool(least <= high and low <= most)
                )
                rows.append(
                    (
                        *(axis, loop, name, promise.flown, promise.nominal, low, high),
                        *(promise.worst, seen.value, least, most, unit, agree),
                    )
                )
    columns = (
        *(Column("axis"), Column("loop"), Column("quantity"), Column("old gains", digits=3)),
        *(Column("promised", digits=3), Column("low", digits=3), Column("high", digits=3)),
        *(Column("worst", digits=3), Column("flown", digits=3)),
        *(Column("95 % low", digits=3), Column("95 % high", digits=3), Column("unit")),
        Column("agree"),
    )
    judged = [row[-1] for row in rows if row[-1] is not None]
    note = f"{sum(map(bool, judged))} of {len(judged)} pairs of 95 % intervals meet."
    return Table("Promised and flown", columns, tuple(rows), (note,))
