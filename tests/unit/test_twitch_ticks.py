"""Stamps of a loop's ticks that scatter, laid even."""

from __future__ import annotations

import numpy as np

from flightid.inspection.signals import Signal
from flightid.review.autotune.twitch_ticks import on_ticks
from tests.closeness import assert_close


def test_stamps_of_spans_come_back_on_the_ticks_of_the_loop() -> None:
    random = np.random.default_rng(1)
    ticks = 0.0025 * np.concatenate([np.arange(400), 800 + np.arange(300)])
    stamps = 20.0 + ticks + 4e-5 * random.standard_normal(ticks.size)
    pair = tuple(Signal(name, stamps, np.zeros(ticks.size), "1", "") for name in ("u", "p"))
    spans = [(float(stamps[100]), float(stamps[399])), (float(stamps[450]), float(stamps[-1]))]
    (moved, same), found = on_ticks((pair[0], pair[1]), spans, 0.08)
    assert moved.time_s is same.time_s
    for span, (first, last) in zip(found, ((100, 399), (450, 699)), strict=True):
        assert span == (moved.time_s[first], moved.time_s[last])
        assert_close(moved.time_s[first:last], 20.0 + ticks[first:last], atol=2e-5, why="means")
        steps = np.diff(moved.time_s[first : last + 1])
        assert_close(steps, steps[0], atol=1e-12, why="one tick")
    # Streams with stamps of their own are no ticks of one loop.
    other = Signal("p", stamps + 1e-3, np.zeros(ticks.size), "rad/s", "")
    assert on_ticks((pair[0], other), spans, 0.08)[0][1] is other
