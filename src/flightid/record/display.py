"""How a record shows itself: the table of its channels and its plain values."""

from __future__ import annotations

import numpy as np

from flightid.record.history import Step
from flightid.record.samples import LabelledSamples
from flightid.table import Column, Table


def summary_table(record: LabelledSamples) -> Table:
    """Table of the channels with unit, role, mean, deviation and range."""
    columns = (
        Column("channel"),
        Column("unit"),
        Column("role"),
        Column("mean"),
        Column("standard deviation"),
        Column("minimum"),
        Column("maximum"),
    )
    rows = tuple(
        (
            key,
            channel.unit,
            str(channel.role),
            float(np.mean(record[key])),
            float(np.std(record[key])),
            float(np.min(record[key])),
            float(np.max(record[key])),
        )
        for key, channel in record.channels.items()
    )
    known = (f"{str(record.input_shape).capitalize()}.",) if record.inputs else ()
    notes = (*known, *(str(step) for step in record.history))
    return Table(repr(record), columns, rows, notes)


def one_line(record: LabelledSamples) -> str:
    """Size, rate and channel names on one line."""
    return (
        f"Record({record.name!r}, {record.n_samples} samples, {record.sample_rate_hz:.6g} Hz, "
        f"{record.duration_s:.6g} s, inputs [{', '.join(record.inputs)}], "
        f"outputs [{', '.join(record.outputs)}])"
    )


def plain_values(record: LabelledSamples) -> dict[str, object]:
    """Plain values, samples included."""
    return {
        "schema": "flightid.record/1",
        "name": record.name,
        "time_s": record.time_s.tolist(),
        "channels": {
            key: {
                "unit": channel.unit,
                "role": str(channel.role),
                "note": channel.note,
                "samples": record[key].tolist(),
            }
            for key, channel in record.channels.items()
        },
        "trim": record.trim,
        **record.input_shape.to_dict(),
        "history": [plain_step(step) for step in record.history],
    }


def plain_step(step: Step) -> dict[str, object]:
    """Plain values of one step of the history."""
    return {
        "operation": step.operation,
        "options": dict(step.options),
        "version": step.version,
    }
