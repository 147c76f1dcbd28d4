"""Rows of the loop: set-points where none were logged, and where the logger lost frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.logs.blackbox.firmware import BETAFLIGHT, REVISION, firmware_of
from flightid.logs.blackbox.settings import settings_of
from flightid.logs.blackbox.stick_rates import stick_rates
from flightid.logs.source import Gap
from flightid.logs.table_source import Array, MessageRows

GAP_FRAMES = 20.0
"""Median steps without a frame that count as a gap."""
LOOP = "main"
STICKS = ("rcCommand", "gyroADC", "axisP")
SET_POINTS = ("setpoint[0]", "setpoint[1]", "setpoint[2]")


def with_set_points(
    tables: dict[str, MessageRows], header: Mapping[str, str]
) -> tuple[dict[str, MessageRows], list[Finding]]:
    """Rate set-points made of the sticks, of a Betaflight that logged none."""
    rows = tables.get(LOOP)
    needed = [f"{name}[{axis}]" for name in STICKS for axis in range(3)]
    is_betaflight = firmware_of(header.get(REVISION, "")).name == BETAFLIGHT
    if rows is None or not is_betaflight or {*SET_POINTS} & {*rows.units}:
        return tables, []
    if not {*needed} <= {*rows.units}:
        return tables, []
    commands, rates, p_terms = (
        np.array([rows.read(f"{name}[{axis}]") for axis in range(3)]) for name in STICKS
    )
    found = stick_rates(commands, rates, p_terms, settings_of(header))
    if found is None or not found.is_borne_out:
        why = "its header tells no rates" if found is None else (
            f"rates by {found.curve}'s curve explain {100.0 * max(found.explained, 0.0):.0f} % of "
            "its P terms: the vehicle levelled itself, or rates were changed in flight"
        )  # fmt: skip
        lacking = Finding(
            "no-set-points",
            Light.AMBER,
            f"the log holds no rate set-points, and none can be made of rcCommand: {why}",
            "fly in acro with one rate profile, or update to Betaflight 4, which logs set-points",
        )
        return tables, [lacking]
    made = dict(zip(SET_POINTS, found.set_points, strict=True))

    def read(column: str) -> Array:
        return made[column] if column in made else rows.read(column)

    said = (
        f"rate set-points are not logged: they are made of rcCommand by {found.curve}'s rates of "
        f"the header, which explain {100.0 * found.explained:.1f} % of the controller's P terms"
    )
    units = {**rows.units, **dict.fromkeys(made, "1")}
    whole = {**tables, LOOP: replace(rows, units=units, read=read)}
    return whole, [Finding("set-points-of-sticks", Light.GREEN, said)]


def gaps_of(time_s: Array) -> list[Gap]:
    """Where the logger lost frames."""
    steps = np.diff(time_s)
    if not steps.size:
        return []
    places = np.flatnonzero(steps > GAP_FRAMES * np.median(steps))
    why = "the logger lost frames"
    return [Gap(float(time_s[i]), float(time_s[i + 1]), why) for i in places]
