"""Outputs of a rig on the grid of its held command: no sample knows what the command does later."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from flightid import feedback_test
from flightid.conventions import Role
from flightid.record import Record
from flightid.record.channel import Channel
from flightid.record.interpolation import Interpolation
from flightid.record.row_grids import ChannelColumn, RowGrid, Rows
from flightid.uncertainty.feedback import find_feedback

STEP_S = 0.02
POLE = np.exp(-5.0 * 0.001)
WANTED = tuple(
    ChannelColumn(Channel(name, "1", role), name)
    for name, role in (("u", Role.INPUT), ("y", Role.OUTPUT))
)
GRID = RowGrid(WANTED, None, None, None, (), None, "time", has_clocks=True)


def rig(seed: int, input_hz: int = 50, *, gain: float = 0.0) -> Rows:
    """A lag of 0.2 s at 1 kHz under a two-level command at 50 Hz; its output logged at 200 Hz.

    With a gain the command follows the output: the loop is closed.
    """
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 500), 120)
    gust = 0.3 * np.repeat(rng.standard_normal(3000), 20)
    y, fed = np.zeros(u.size), 0.0
    for k in range(1, y.size):
        y[k] = POLE * y[k - 1] + (1 - POLE) * (u[k - 1] + gust[k - 1])
        fed = gain * y[k] if k % 20 == 0 else fed
        u[k] -= fed
    time_s, every = np.arange(u.size) * 0.001, 1000 // input_hz
    seen = slice(2, None, 5)
    noise = 0.02 * rng.standard_normal(y[seen].size)
    return {"u": (time_s[::every], u[::every]), "y": (time_s[seen], y[seen] + noise)}


@pytest.mark.parametrize("input_hz", [50, 200])
def test_an_open_rig_with_a_faster_output_is_not_called_closed(input_hz: int) -> None:
    for seed in range(3):
        rows = rig(seed, input_hz)
        grid = replace(GRID, resample_to_s=STEP_S)
        assert set(grid.methods(rows, STEP_S).values()) == {
            Interpolation.PREVIOUS, Interpolation.POINT
        }  # fmt: skip
        _, made, _ = grid.pieces(rows, ())[0]
        u, y = (made[name] - np.mean(made[name]) for name in ("u", "y"))
        assert find_feedback([u[None]], [y[None]], ["u"]).loop == "open"


def test_a_closed_rig_is_found_by_samples_at_the_instants() -> None:
    for seed in range(3):
        rows = rig(seed, gain=2.0)
        assert GRID.methods(rows, STEP_S)["y"] is Interpolation.POINT
        _, made, _ = replace(GRID, resample_to_s=STEP_S).pieces(rows, ())[0]
        u, y = (made[name] - np.mean(made[name]) for name in ("u", "y"))
        assert find_feedback([u[None]], [y[None]], ["u"]).loop == "closed"


def test_a_low_passed_output_leaves_the_loop_unknown() -> None:
    _, made, steps = replace(GRID, interpolation={"y": "band-limited"}).pieces(rig(0), ())[0]
    time_s = STEP_S * np.arange(made["u"].size)
    plain = Record.from_arrays(time_s, inputs={"u": made["u"]}, outputs={"y": made["y"]})
    assert feedback_test(plain).loop == "closed"
    told = plain.replace({}, step=steps[-1])
    assert (feedback_test(told).loop, feedback_test(told).source) == ("unknown", "filtered")


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5])
def test_a_line_above_the_new_nyquist_frequency_is_named(share: float) -> None:
    rows = rig(1)
    time_s, y = rows["y"]
    size = np.sqrt(2.0 * share / (1.0 - share) * np.var(y))
    rows = {**rows, "y": (time_s, y + size * np.sin(2.0 * np.pi * 83.0 * time_s))}
    for interpolation in (None, {"y": "band-limited"}):
        grid = replace(GRID, interpolation=interpolation)
        steps = grid.pieces(rows, ())[0][2]
        found = [step.options for step in steps if step.options.get("code") == "folded-power"]
        assert bool(found) is (share == 0.5 and interpolation is None)
        for each in found:
            text = r"y: (\d+) % of its power lies above 25 Hz, most at 83 Hz"
            said = re.search(text, str(each["found"]))
            assert said is not None
            # Windows of 5 s see a little less of the slow motion of some than of others.
            assert abs(int(said[1]) - 50) <= 3
            assert "folds to 17 Hz" in str(each["found"])
            assert "'y': 'band-limited'" in str(each["action"])
