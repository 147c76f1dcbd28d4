"""Pictures and report blocks of margins: what they draw is what the results hold."""

from __future__ import annotations

import numpy as np

import flightid as fid
from flightid.plot.margins import (
    disk_figure,
    disturbance_figure,
    loop_bode,
    loop_nichols,
    loop_nyquist,
)
from flightid.report.content import Document, Section
from flightid.report.html import to_html
from flightid.report.margins import disk_blocks, disturbance_blocks, margin_blocks
from tests.closeness import assert_close


def measured(gain=4.0):
    omega = np.geomspace(0.5, 40.0, 80)
    loop = fid.LinearSystem([[0.0]], [[gain]], [[1.0]], [[0.0]], ("e",), ("y",), [0.1])
    return fid.FrequencyResponse.from_values(
        omega,
        loop.frequency_response(omega),
        inputs=["e"],
        outputs=["y"],
        random_error=np.full((1, 1, 80), 0.02),
    )


def traces(figure):
    return {each.name: each for each in figure.data}


def named(figure, start):
    return next(each for each in figure.data if each.name and each.name.startswith(start))


def test_bode_marks_margins_where_they_are_taken():
    found = fid.margins(measured())
    made = loop_bode(found)
    phase = named(made, "phase margin")
    assert_close(phase.x, [found.crossover.value] * 2, rtol=1e-12, why="at the crossover")
    assert_close(np.ptp(phase.y), found.phase_margin.value, rtol=1e-3, why="as long as the margin")
    gain = named(made, "gain margin")
    assert_close(np.ptp(gain.y), found.gain_margin.value, rtol=1e-3, why="as long as the margin")
    place = next(k for k, each in enumerate(made.data) if each.fill == "tonexty")
    width = np.asarray(made.data[place].y) - np.asarray(made.data[place - 1].y)
    assert_close(width, 2 * 1.959964 * 20 / np.log(10) * 0.02, rtol=1e-2, why="95 % of 2 %")


def test_nyquist_disk_touches_the_loop():
    found, disk = fid.margins(measured()), fid.disk_margin(measured())
    for made, name in ((loop_nyquist(found, disk), "disk"), (loop_nyquist(found), "modulus")):
        edge = named(made, f"{name} margin")
        centre = 0.5 * (np.max(edge.x) + np.min(edge.x))
        radius = 0.5 * (np.max(edge.x) - np.min(edge.x))
        distance = np.abs(found.curve.response - centre)
        assert np.all(distance > radius * 0.999)
        assert_close(np.min(distance), radius, rtol=0.01, why="tangent")
    one = named(made, "phase margin")
    assert_close(np.hypot(one.x[0], one.y[0]), 1.0, rtol=1e-9, why="on the unit circle")


def test_nichols_keeps_the_guides_free():
    made = loop_nichols(fid.margins(measured()), phase_guide_deg=30.0, gain_guide_db=4.0)
    zone = traces(made)["30° and 4 dB"]
    assert_close([np.min(zone.x), np.max(zone.x)], [-210, -150], rtol=1e-9, why="±30°")
    crossover = traces(made)["crossover"]
    assert_close(crossover.x[0] + 180, 67.08, atol=0.1, why="phase margin")


def test_disturbance_and_disk():
    found = fid.disturbance_rejection(measured())
    made = disturbance_figure(found)
    assert named(made, "bandwidth").y[0] == -3.0
    assert_close(named(made, "peak").y[0], found.peak.value, rtol=1e-12, why="the peak")
    disk = fid.disk_margin(measured())
    assert_close(
        named(disk_figure(disk), "disk margin").y[0], disk.alpha.value, rtol=1e-12, why="least"
    )


def test_unstable_loops_are_drawn_too():
    wild = fid.margins(measured(30.0))
    disk = fid.disk_margin(measured(30.0))
    assert not [each for each in loop_nyquist(wild, disk).data if each.fill == "toself"]
    assert named(loop_bode(wild), "gain margin").name.startswith("gain margin -")
    assert not [each.name for each in disk_figure(disk).data if each.name.startswith("disk margin")]


def test_report_shows_all_of_it():
    found, disk = fid.margins(measured()), fid.disk_margin(measured())
    blocks = margin_blocks(found, disk) + disturbance_blocks(fid.disturbance_rejection(measured()))
    assert disk_blocks(disk)[-1] in blocks
    page = to_html(Document("Loop", "flown", (Section("Margins", blocks),)))
    for words in ("phase margin", "Disk margin at y", "disturbance-rejection bandwidth"):
        assert words in page
