"""Pictures of connections show every block, every signal and the limits."""

from __future__ import annotations

import numpy as np

import flightid as fid
from flightid.plot.loops import diagram, step

L = fid.loops


def loop() -> fid.Interconnection:
    return fid.connect(
        [L.sum_of("e", "r", "-y"), L.gain("e", "u", 9.0), L.limiter("u", "v", 1.0),
         L.transfer("v", "y", [1.0], [1.0, 0.5])],
        inputs=["r"], outputs=["y", "v"],
    )  # fmt: skip


def test_the_diagram_names_all_blocks_and_signals() -> None:
    made = diagram(loop())
    texts = " ".join(each.text for each in made.layout.annotations)
    for word in ("sum", "gain", "limiter", "transfer function", "e", "u", "v", "y", "r"):
        assert word in texts
    boxes = [each for each in made.layout.shapes if each.type == "rect"]
    assert len(boxes) == 4
    assert len({(box.x0, box.y0) for box in boxes}) == 4
    # One signal runs back, below all blocks.
    back = [each for each in made.layout.shapes if each.type == "path"]
    assert len(back) == 1


def test_a_step_shows_the_limit() -> None:
    made = step(loop(), "r", size=2.0, duration_s=3.0, sample_time_s=0.02)
    names = [trace.name for trace in made.data]
    assert names == ["y", "v"]
    assert float(np.max(made.data[1].y)) == 1.0
    assert len(made.data[0].x) == 151
