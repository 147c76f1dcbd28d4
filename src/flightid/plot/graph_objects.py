"""Figures as the browser's plotting library, plotly.js, takes them: data and layout, nothing else.

`plotly.graph_objects.Figure(figure.to_dict())` makes one of Plotly's own of a figure.
"""

from __future__ import annotations

import base64
import copy
import gzip
import json
import tempfile
import webbrowser
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from flightid.files import write_atomically

HOLDERS = {"line", "marker", "title", "font", "tickfont", "minor", "legend", "margin"}
"""Properties that hold properties: there as soon as they are asked for."""
LIBRARY = "plotly-cartesian.min.js.gz"
"""Version 4.1.1, as its first lines say; npm: plotly.js-cartesian-dist-min."""


def plotting_library() -> str:
    """Text of plotly.js with the plots of two axes."""
    return gzip.decompress((files("flightid.plot") / LIBRARY).read_bytes()).decode()


class Node(dict[str, Any]):
    """Properties by name, as items and as attributes; None where one is not set."""

    def __init__(self, values: Mapping[str, Any] | None = None) -> None:
        super().__init__()
        self.merge(values or {})

    def merge(self, values: Mapping[str, Any]) -> None:
        """Set properties; those of a property are merged into what it holds."""
        for name, value in values.items():
            if isinstance(value, Mapping):
                held = self.setdefault(name, Node())
                held.merge(value)
            else:
                self[name] = value

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        if name.startswith("__"):
            raise AttributeError(name)
        return self.setdefault(name, Node()) if name in HOLDERS else self.get(name)

    def __setattr__(self, name: str, value: object) -> None:
        self[name] = Node(value) if isinstance(value, Mapping) else value


def Scatter(**properties: object) -> Node:  # noqa: N802 - a name of Plotly
    """Points and lines."""
    return Node({"type": "scatter", **properties})


def Bar(**properties: object) -> Node:  # noqa: N802
    """Bars."""
    return Node({"type": "bar", **properties})


def Heatmap(**properties: object) -> Node:  # noqa: N802
    """Colours by cell."""
    return Node({"type": "heatmap", **properties})


def Contour(**properties: object) -> Node:  # noqa: N802
    """Lines of equal height."""
    return Node({"type": "contour", **properties})


class PlotFigure:
    """A grid of plots; rows and columns count from 1.

    Parameters
    ----------
    rows, columns : int
        Number of plots.
    row_heights : sequence of float, optional
        Relative heights.
    column_titles : sequence of str
        One above each column.
    shared_x : bool
        Plots of a column share their x axis.
    between_rows : float
        Part of the height that is left free between rows, all gaps together.
    """

    def __init__(
        self,
        rows: int = 1,
        columns: int = 1,
        *,
        row_heights: Sequence[float] | None = None,
        column_titles: Sequence[str] = (),
        shared_x: bool = False,
        between_rows: float = 0.07,
    ) -> None:
        self.data: list[Node] = []
        self.layout = Node({"annotations": [], "shapes": []})
        self._shape = rows, columns
        heights = _spans(np.array(row_heights or [1.0] * rows)[::-1], between_rows * (rows > 1))
        widths = _spans(np.ones(columns), 0.09 * (columns - 1))
        for row, column, number in self._places():
            x, y = self._axes(row, column)
            x["domain"], y["domain"] = widths[column - 1], heights[rows - row]
            x["anchor"], y["anchor"] = f"y{number}", f"x{number}"
            if shared_x and row < rows:
                x["matches"], x["showticklabels"] = (
                    f"x{_number((rows - 1) * columns + column)}",
                    False,
                )
        for (low, high), title in zip(widths, column_titles, strict=False):
            self.add_annotation(
                x=0.5 * (low + high), y=1.0, xref="paper", yref="paper", text=title,
                xanchor="center", yanchor="bottom", showarrow=False, font={"size": 16},
            )  # fmt: skip

    def copied(self) -> PlotFigure:
        """A figure of its own with the same content."""
        return copy.deepcopy(self)

    def add_trace(self, trace: Node, row: int = 1, col: int = 1) -> None:
        """Add a series to a plot."""
        number = _number((row - 1) * self._shape[1] + col)
        self.data.append(Node({**trace, "xaxis": f"x{number}", "yaxis": f"y{number}"}))

    def add_traces(self, traces: Iterable[Node], rows: int = 1, cols: int = 1) -> None:
        """Add several series to one plot."""
        for trace in traces:
            self.add_trace(trace, rows, cols)

    def update_layout(self, **properties: object) -> None:
        """Set properties of the whole."""
        self.layout.merge(properties)

    def update_xaxes(
        self, *, row: int | None = None, col: int | None = None, **properties: object
    ) -> None:
        """Set properties of the x axes of a row, a column, or all."""
        for axis in self.select_xaxes(row, col):
            axis.merge(_nested(properties))

    def update_yaxes(
        self, *, row: int | None = None, col: int | None = None, **properties: object
    ) -> None:
        """Set properties of the y axes of a row, a column, or all."""
        for axis in self.select_yaxes(row, col):
            axis.merge(_nested(properties))

    def select_xaxes(self, row: int | None = None, col: int | None = None) -> Iterator[Node]:
        """X axes of a row, a column, or all, top to bottom."""
        return (self._axes(*place)[0] for place in self._selected(row, col))

    def select_yaxes(self, row: int | None = None, col: int | None = None) -> Iterator[Node]:
        """Y axes of a row, a column, or all, top to bottom."""
        return (self._axes(*place)[1] for place in self._selected(row, col))

    def add_annotation(
        self, row: int | None = None, col: int | None = None, **properties: object
    ) -> None:
        """Write a text."""
        self.layout["annotations"].append(Node(self._beside(row, col, properties)))

    def add_shape(
        self, row: int | None = None, col: int | None = None, **properties: object
    ) -> None:
        """Draw a shape."""
        self.layout["shapes"].append(Node(self._beside(row, col, _nested(properties))))

    def add_hline(
        self,
        y: float,
        row: int | None = None,
        col: int | None = None,
        annotation_text: str = "",
        annotation_position: str = "top right",
        annotation_font: Mapping[str, Any] | None = None,
        **properties: Any,  # noqa: ANN401 - any property
    ) -> None:
        """Draw a level across the plots of a row, a column, or all, with a text at its end."""
        side = "left" if "left" in annotation_position else "right"
        above = "top" not in annotation_position
        for place in self._selected(row, col):
            x = f"x{_number(self._index(*place))} domain"
            self.add_shape(*place, type="line", x0=0, x1=1, y0=y, y1=y, **properties)
            self.layout["shapes"][-1]["xref"] = x
            if annotation_text:
                self.add_annotation(
                    *place, text=annotation_text, x=float(side == "right"), y=y, xanchor=side,
                    yanchor="top" if above else "bottom", showarrow=False,
                    font=annotation_font or {},
                )  # fmt: skip
                self.layout["annotations"][-1]["xref"] = x

    def add_vline(
        self, x: float, row: int | None = None, col: int | None = None, **properties: object
    ) -> None:
        """Draw an upright line through the plots of a row, a column, or all."""
        self._upright("line", x, x, row, col, properties)

    def add_vrect(
        self,
        x0: float,
        x1: float,
        row: int | None = None,
        col: int | None = None,
        **properties: object,
    ) -> None:
        """Shade a range of x in the plots of a row, a column, or all."""
        self._upright("rect", x0, x1, row, col, properties)

    def _upright(
        self, kind: str, x0: float, x1: float, row: int | None, col: int | None,
        properties: Mapping[str, Any],
    ) -> None:  # fmt: skip
        for place in self._selected(row, col):
            self.add_shape(*place, type=kind, x0=x0, x1=x1, y0=0, y1=1, **properties)
            self.layout["shapes"][-1]["yref"] = f"y{_number(self._index(*place))} domain"

    def to_dict(self) -> dict[str, Any]:
        """Data and layout as plain values; numbers of arrays as plotly.js unpacks them."""
        return {"data": [_plain(each) for each in self.data], "layout": _plain(self.layout)}

    def to_json(self) -> str:
        """Data and layout as JSON."""
        return json.dumps(self.to_dict(), allow_nan=False)

    def write_html(self, path: str | Path) -> Path:
        """Write a page that shows the figure without a network.

        Raises
        ------
        OSError
            The folder is missing or cannot be written.
        """
        drawn = self.to_json().replace("<", "\\u003c")
        return write_atomically(
            path,
            '<!doctype html><meta charset="utf-8"><div id="plot"></div>'
            f"<script>{plotting_library()}</script><script>const spec = {drawn};"
            'Plotly.newPlot("plot", spec.data, spec.layout, {responsive: true});</script>',
        )

    def show(self) -> None:
        """Open the figure in a browser."""
        folder = Path(tempfile.mkdtemp(prefix="flightid-"))
        webbrowser.open(self.write_html(folder / "figure.html").as_uri())

    def _places(self) -> Iterator[tuple[int, int, str]]:
        for row in range(1, self._shape[0] + 1):
            for column in range(1, self._shape[1] + 1):
                yield row, column, _number(self._index(row, column))

    def _index(self, row: int, column: int) -> int:
        return (row - 1) * self._shape[1] + column

    def _axes(self, row: int, column: int) -> tuple[Node, Node]:
        number = _number(self._index(row, column))
        x, y = (self.layout.setdefault(f"{each}axis{number}", Node()) for each in "xy")
        return x, y

    def _selected(self, row: int | None, col: int | None) -> list[tuple[int, int]]:
        places = [(r, c) for r, c, _ in self._places()]
        return [each for each in places if row in (None, each[0]) and col in (None, each[1])]

    def _beside(
        self, row: int | None, col: int | None, properties: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Properties with the axes of a plot, where one is named."""
        if row is None and col is None:
            return dict(properties)
        number = _number(self._index(row or 1, col or 1))
        return {"xref": f"x{number}", "yref": f"y{number}", **properties}


def _number(index: int) -> str:
    """What stands behind x and y of the plot of an index: nothing, 2, 3, …."""
    return "" if index == 1 else str(index)


def _spans(sizes: np.ndarray, spaces: float) -> list[tuple[float, float]]:
    """Parts of the unit length with sizes in proportion, and equal spaces that sum to `spaces`."""
    lengths = (1.0 - spaces) * sizes / np.sum(sizes)
    gap = spaces / max(1, sizes.size - 1)
    lows = np.concatenate([[0.0], np.cumsum(lengths + gap)[:-1]])
    return [(float(low), float(low + length)) for low, length in zip(lows, lengths, strict=True)]


def _nested(properties: Mapping[str, Any]) -> dict[str, Any]:
    """`title_text` and `line_width` as properties of title and line."""
    made = Node()
    for name, value in properties.items():
        head, _, tail = name.partition("_")
        made.merge({head: {tail: value}} if tail and head in HOLDERS else {name: value})
    return made


def _plain(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    if isinstance(value, Mapping):
        inner = {key: _plain(each) for key, each in value.items()}
        return {key: each for key, each in inner.items() if each is not None and each != {}}
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiu":
        return _packed(value)
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def _packed(values: np.ndarray) -> dict[str, Any]:
    """Numbers as bytes, which plotly.js takes of at most 32 bits where they are whole."""
    if values.dtype.kind in "iu":
        low, high = int(values.min(initial=0)), int(values.max(initial=0))
        fits = low >= -(1 << 31) and high < 1 << 31
        values = values.astype("<i4" if fits else "<f8")
    else:
        values = values.astype("<f4" if values.dtype.itemsize < 8 else "<f8")
    content = base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()
    made = {"dtype": values.dtype.str[1:], "bdata": content}
    return made if values.ndim == 1 else {**made, "shape": ", ".join(map(str, values.shape))}
