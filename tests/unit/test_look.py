from __future__ import annotations

import numpy as np

from flightid.plot import look


def test_axes_carry_titles_with_units_and_share_x() -> None:
    made = look.figure(2, title="two")
    made.add_trace(look.line("p", [1, 10], [0, 1], colour=look.MODEL), row=1, col=1)
    look.label_axes(
        made,
        x=look.axis_title("frequency", "rad/s"),
        y=("gain [dB]", "phase [deg]"),
        log_x=True,
    )
    layout = made.to_dict()["layout"]
    assert layout["yaxis"]["title"]["text"] == "gain [dB]"
    assert layout["xaxis2"]["title"]["text"] == "frequency [rad/s]"
    assert "title" not in layout["xaxis"]
    assert layout["xaxis"]["type"] == layout["xaxis2"]["type"] == "log"
    assert layout["xaxis"]["matches"] == "x2"


def test_band_hides_with_its_series_and_fills_between() -> None:
    x = np.array([1.0, 2.0])
    low, high = look.band("p", x, x - 1, x + 1, colour="#0072b2")
    assert (low.legendgroup, high.legendgroup) == ("p", "p")
    assert high.fill == "tonexty"
    assert high.fillcolor == "rgba(0,114,178,0.16)"
    assert not low.showlegend
