"""The time history behind fitted responses, as a report draws it."""

from __future__ import annotations

import numpy as np

import flightid as fid
from flightid.plot.thinning import thinned_on_shared_stamps
from flightid.plot.training import training_history
from tests.closeness import assert_close


def _record(name: str, seconds: float, seed: int) -> fid.Record:
    time_s = 5.0 + np.arange(0.0, seconds, 0.01)
    rng = np.random.default_rng(seed)
    moved, p = rng.standard_normal((2, time_s.size))
    return fid.Record.from_arrays(
        time_s,
        inputs={"u": moved, "still": 0 * time_s},
        outputs={"p": p},
        excitations={"chirp": 0.5 * moved},
        units={"p": "rad/s"},
        name=name,
    )


def test_records_follow_each_other_with_every_peak() -> None:
    """Channels keep their extremes, on stamps that all share; what rests is left out."""
    records = [_record("first", 30.0, 1), _record("second", 60.0, 2)]
    drawn = training_history(records, ("u", "still"), ("p",), ("chirp",))
    assert [trace.name for trace in drawn.data] == ["chirp"] * 2 + ["input"] * 2 + ["output"] * 2
    stamps = [np.array(trace.x) for trace in drawn.data]
    for one, other in zip(stamps[::2], stamps[1::2], strict=True):
        ends = [one[0], one[-1], other[0], other[-1]]
        assert_close(ends, [0.0, 29.99, 30.9, 90.9], atol=0.3, why="a gap between them")
        np.testing.assert_array_equal(one, stamps[0])
        np.testing.assert_array_equal(other, stamps[1])
    for trace, record in zip(drawn.data[4:], records, strict=True):
        ends = (np.min, np.max)
        shown, true = ([end(of) for end in ends] for of in (np.array(trace.y), record["p"]))
        assert_close(shown, true, atol=np.ptp(record["p"]) / 2**9, why="rounded for the screen")
    assert sum(each.size for each in stamps[:2]) <= 902


def test_one_record_keeps_its_own_time() -> None:
    (trace,) = training_history([_record("alone", 3.0, 1)], (), ("p",)).data
    assert_close(
        np.array(trace.x), 5.0 + np.arange(0.0, 3.0, 0.01), atol=1e-9, why="its own stamps"
    )


def test_extremes_stand_in_their_order() -> None:
    rng = np.random.default_rng(3)
    time_s, samples = np.arange(10_000.0), rng.standard_normal(10_000)
    samples[1234], samples[1239] = 9.0, -9.0
    stamps, kept = thinned_on_shared_stamps(time_s, samples, 400)
    assert stamps.size == kept.size == 400
    assert np.all(np.diff(stamps) > 0)
    peak = int(np.argmax(kept))
    assert (kept[peak], kept[peak + 1]) == (9.0, -9.0)
