"""Polynomial models: the scan of orders, poles and zeros with their errors, pulse responses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.identification import Fit, ImpulseResponse
from flightid.identification.prediction_error.roots import FittedRoot
from flightid.identification.subspace.roots import ALL
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.uncertainty.quantiles import ellipse_radius, half_width, interval_words, shown
from flightid.validation import OrderScan
from flightid.validation.order_scan.edges import Structure
from flightid.validation.order_scan.result import words_of

LEAST_ZOOM, MARGIN, SMALLEST = 1.5, 1.3, 1e-4
"""How much closer a second look at the poles has to be, its room about them, least half width."""
BESIDE = ([0.0, 0.44], [0.56, 1.0])
"""Shares of the width for the planes, with room for numbers such as −1.5×10⁻⁴ between them."""
HIGHEST = 3.0
"""Errors beyond this many times the smallest are drawn at the upper edge."""


def order_scan(scan: OrderScan, taken: Structure | None = None) -> go.PlotFigure:
    """Draw free-run error and (of one kind) BIC of structures over their coefficients.

    Parameters
    ----------
    scan : OrderScan
        Result of `flightid.scan_orders`.
    taken : structure, optional
        Structure that was taken in the end, marked too.

    Returns
    -------
    PlotFigure
    """
    several = scan.is_of_several_kinds
    made = look.figure(1 if several else 2)
    kept = [t for t in scan.trials if t.free_run_rms is not None and (several or t.criteria)]
    counts = [t.n_parameters for t in kept]
    rms = np.array([t.free_run_rms for t in kept], dtype=np.float64)
    bic = np.array([t.criteria.bic if t.criteria else None for t in kept], dtype=np.float64)
    words = [words_of(scan, t) for t in kept]
    top = HIGHEST * float(rms.min())
    rows = [(1, np.minimum(rms, top))] if several else [(1, np.minimum(rms, top)), (2, bic)]
    for row, values in rows:
        made.add_trace(
            go.Scatter(
                x=counts,
                y=values,
                text=words,
                name="structures",
                legendgroup="structures",
                showlegend=row == 1,
                mode="markers",
                marker={"color": look.MODEL, "size": 6, "opacity": 0.45},
                hovertemplate="%{text}: %{y:.5g}",
            ),
            row=row,
            col=1,
        )
    marked = [
        ("smallest free-run error", scan.trials[0], look.RIVAL),
        ("simplest within 2 %", scan.simplest, look.TRUTH),
    ]
    marked += [("taken", trial, look.BLACK) for trial in kept if trial.structure == taken]
    for name, trial, colour in marked:
        if trial not in kept:
            continue
        place = kept.index(trial)
        for row, value in [(1, rms[place]), (2, bic[place])][: len(rows)]:
            made.add_trace(
                go.Scatter(
                    x=[counts[place]],
                    y=[value],
                    name=f"{name}: {words_of(scan, trial)}",
                    legendgroup=name,
                    showlegend=row == 1,
                    mode="markers",
                    marker={"color": colour, "size": 12, "symbol": "diamond"},
                ),
                row=row,
                col=1,
            )
    look.label_axes(
        made, x="coefficients", y=[look.axis_title("free-run rms", scan.unit), "BIC"][: len(rows)]
    )
    made.update_layout(hovermode="closest")
    return made


def pole_zero(fit: Fit, response: str | None = None) -> go.PlotFigure:
    """Draw poles and zeros in the z plane with 95 % ellipses, and the unit circle.

    Beside it the poles' own corner of the upper half plane, where they lie close together.

    Parameters
    ----------
    fit : Fit
        Of a polynomial or innovations model.
    response : str, optional
        ``"output/input"``; default: the first.

    Returns
    -------
    PlotFigure
    """
    name = response or f"{fit.model.outputs[0]}/{fit.model.inputs[0]}"
    within = [root for root in fit.details.roots if root.response in (name, ALL)]
    box = _around_poles(within)
    reach = min(max([1.15, *(abs(root.z) * 1.1 for root in within)]), 3.0)
    zooms = box is not None and box[1] < reach / LEAST_ZOOM
    made = look.figure(1, 2 if zooms else 1, shared_x=False, height_px=480 if zooms else 560)
    for column in (1, 2)[: 1 + zooms]:
        _add_roots(made, within, column)
        made.update_xaxes(title_text="real", col=column)
    # The one title serves both planes: small numbers of the right one fill the room between them.
    made.update_yaxes(title_text="imaginary", col=1)
    made.update_xaxes(range=[-reach, reach], col=1)
    made.update_yaxes(range=[-reach, reach], scaleanchor="x", col=1)
    if zooms and box is not None:
        centre, half = box
        made.update_xaxes(range=[centre.real - half, centre.real + half], col=2)
        made.update_yaxes(range=[centre.imag - half, centre.imag + half], scaleanchor="x2", col=2)
        for column, domain in ((1, BESIDE[0]), (2, BESIDE[1])):
            made.update_xaxes(domain=domain, col=column)
    made.update_layout(hovermode="closest")
    return made


def _around_poles(within: Sequence[FittedRoot]) -> tuple[complex, float] | None:
    """Middle and half the width of a square about the poles of one half plane, ellipses too."""
    edges: list[NDArray[np.float64]] = []
    for root in within:
        if root.kind != "pole":
            continue
        z = complex(root.z.real, abs(root.z.imag))
        x, y = np.array([z.real]), np.array([z.imag])
        if root.covariance is not None:
            x, y = _ellipse(z, root.covariance, 1.0)
        edges.append(np.array([np.min(x), np.max(x), np.min(y), np.max(y)]))
    if not edges:
        return None
    low_x, _, low_y, _ = np.min(edges, axis=0)
    _, high_x, _, high_y = np.max(edges, axis=0)
    half = MARGIN * 0.5 * max(high_x - low_x, high_y - low_y)
    return complex(0.5 * (low_x + high_x), 0.5 * (low_y + high_y)), max(float(half), SMALLEST)


def _add_roots(made: go.PlotFigure, within: Sequence[FittedRoot], column: int) -> None:
    angle = np.linspace(0.0, 2 * np.pi, 181 if column == 1 else 1441)
    legend = column == 1
    circle = look.line(
        "unit circle", np.cos(angle), np.sin(angle), colour=look.LINE, width=1.0, legend=legend
    )
    made.add_trace(circle, 1, column)
    styles = {"pole": ("x", look.MODEL), "zero": ("circle-open", look.RIVAL)}
    for kind, (symbol, colour) in styles.items():
        shown = [root for root in within if root.kind == kind]
        places = [z for root in shown for z in _both(root.z)]
        cloud = go.Scatter(
            x=[z.real for z in places], y=[z.imag for z in places], name=f"{kind}s",
            legendgroup=kind, mode="markers", showlegend=legend and bool(places),
            marker={"color": colour, "symbol": symbol, "size": 10 if legend else 7,
                    "line": {"width": 2 if legend else 1}},
        )  # fmt: skip
        made.add_trace(cloud, 1, column)
        for root in shown:
            if root.covariance is None:
                continue
            for z, sign in zip(_both(root.z), (1.0, -1.0), strict=False):
                x, y = _ellipse(z, root.covariance, sign)
                edge = look.line(f"{kind}s", x, y, colour=colour, width=1.0, legend=False)
                edge.merge({"legendgroup": kind, "hoverinfo": "skip"})
                made.add_trace(edge, 1, column)


def _both(z: complex) -> list[complex]:
    return [z, z.conjugate()] if z.imag else [z]


def _ellipse(
    centre: complex, covariance: NDArray[np.float64], sign: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    values, vectors = np.linalg.eigh(covariance)
    angle = np.linspace(0.0, 2 * np.pi, 61)
    round_ = np.array([np.cos(angle), np.sin(angle)])
    x, y = vectors @ (ellipse_radius(shown()) * np.sqrt(np.maximum(values, 0.0))[:, None] * round_)
    return centre.real + x, centre.imag + sign * y


def impulse_response(item: ImpulseResponse, name: str | None = None) -> go.PlotFigure:
    """Draw pulse and step response of one input with their 95 % bands.

    Parameters
    ----------
    item : ImpulseResponse
        Result of `flightid.impulse_response`.
    name : str, optional
        Input; default: the first.

    Returns
    -------
    PlotFigure
    """
    place = 0 if name is None else item.inputs.index(name)
    name = item.inputs[place]
    made = look.figure(2)
    steps, errors = item.step()
    causal = item.lags >= 0
    curves = (
        (item.time_s, item.values[place], item.stderr),
        (item.time_s[causal], steps[place], errors),
    )
    for row, (time, values, wide) in enumerate(curves, start=1):
        if wide is not None:
            # The band lies about zero for pulses: outside it, chance does not explain a lag.
            middle, half = 0.0 * values if row == 1 else values, half_width(shown()) * wide[place]
            words, ends = interval_words(shown()), (middle - half, middle + half)
            for edge in look.band(words, time, *ends, colour=look.TRUTH):
                made.add_trace(edge, row=row, col=1)
        if row == 1:
            bars = go.Bar(x=time, y=values, name="pulse", marker={"color": look.MODEL})
            made.add_trace(bars, row=row, col=1)
        else:
            made.add_trace(look.line("step", time, values, colour=look.MODEL), row=row, col=1)
    look.label_axes(
        made, x="time [s]", y=[f"{item.output} to pulse of {name}", f"{item.output} to step"]
    )
    return made
