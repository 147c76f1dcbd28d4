"""A figure as plain values for the content tree, small enough to embed."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flightid.report.content import Figure

if TYPE_CHECKING:
    from flightid.plot import graph_objects as go

SINGLE_LIMIT = 3e38
"""Just inside the range of single precision."""
ACROSS, OF_ITSELF = 2.0**-11, 2.0**-10
"""Steps of a kept sample, in its curve's range and in its own size: a quarter of a pixel of a panel
500 px high, and 0.1 % of a number on a logarithmic axis, below 0.01 dB. What lies beneath is noise
that no packing shrinks."""


def figure_block(figure: go.PlotFigure, caption: str, *, folded: bool = False) -> Figure:
    """Take a picture into the content tree.

    Parameters
    ----------
    figure : flightid.plot.graph_objects.PlotFigure
        Picture; its samples are kept as finely as a screen shows them.
    caption : str
        What to see in it.
    folded : bool
        Open it on demand.
    """
    return Figure(_in_single_precision(figure.to_dict()), caption, folded)


def _in_single_precision(node: Any) -> Any:  # noqa: ANN401 — any JSON value
    if isinstance(node, list):
        return [_in_single_precision(item) for item in node]
    if not isinstance(node, dict):
        return node
    if node.get("dtype") == "f8" and "bdata" in node:
        double = np.frombuffer(base64.b64decode(node["bdata"]), dtype="<f8")
        # A prediction that diverged does not fit; no screen shows where it went.
        samples = _as_seen(np.clip(double, -SINGLE_LIMIT, SINGLE_LIMIT)).astype("<f4")
        return {**node, "dtype": "f4", "bdata": base64.b64encode(samples.tobytes()).decode()}
    return {key: _in_single_precision(value) for key, value in node.items()}


def _as_seen(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """Samples rounded to binary steps that no screen shows.

    Example
    -------
    >>> _as_seen(np.array([0.0, 0.1, 1000.0, np.nan])).tolist()
    [0.0, 0.0999755859375, 1000.0, nan]
    """
    known = samples[np.isfinite(samples)]
    wide = float(np.ptp(known)) if known.size else 0.0
    size = np.where((samples == 0.0) | ~np.isfinite(samples), wide or 1.0, np.abs(samples))
    step = np.minimum(ACROSS * wide, OF_ITSELF * size) if wide else OF_ITSELF * size
    step = np.exp2(np.floor(np.log2(np.maximum(step, np.finfo(np.float32).tiny))))
    return np.asarray(np.round(samples / step) * step)
