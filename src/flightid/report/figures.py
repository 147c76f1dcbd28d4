"""A figure as plain values for the content tree, small enough to embed."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING, Any

import numpy as np

from flightid.report.content import Figure

if TYPE_CHECKING:
    from flightid.plot import graph_objects as go

SINGLE_LIMIT = 3e38
"""Just inside the range of single precision."""


def figure_block(figure: go.PlotFigure, caption: str, *, folded: bool = False) -> Figure:
    """Take a picture into the content tree.

    Parameters
    ----------
    figure : flightid.plot.graph_objects.PlotFigure
        Picture; its samples are kept in single precision, which no screen can tell from double.
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
        samples = np.clip(double, -SINGLE_LIMIT, SINGLE_LIMIT).astype("<f4")
        return {**node, "dtype": "f4", "bdata": base64.b64encode(samples.tobytes()).decode()}
    return {key: _in_single_precision(value) for key, value in node.items()}
