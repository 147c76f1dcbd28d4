"""Polynomial models: the scan of orders, poles and zeros with their errors, pulse responses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.identification import Fit, ImpulseResponse
from flightid.identification.subspace.roots import ALL
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.uncertainty.quantiles import ellipse_radius, half_width, interval_words, shown
from flightid.validation import OrderScan
from flightid.validation.order_scan.edges import Structure
from flightid.validation.order_scan.result import words_of

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
    made = look.figure(1, height_px=560)
    angle = np.linspace(0.0, 2 * np.pi, 181)
    made.add_trace(
        look.line("unit circle", np.cos(angle), np.sin(angle), colour=look.LINE, width=1.0)
    )
    styles = {"pole": ("x", look.MODEL), "zero": ("circle-open", look.RIVAL)}
    for kind, (symbol, colour) in styles.items():
        shown = [root for root in within if root.kind == kind]
        places = [z for root in shown for z in _both(root.z)]
        made.add_trace(
            go.Scatter(
                x=[z.real for z in places],
                y=[z.imag for z in places],
                name=f"{kind}s",
                legendgroup=kind,
                mode="markers",
                marker={"color": colour, "symbol": symbol, "size": 10, "line": {"width": 2}},
            )
        )
        for root in shown:
            if root.covariance is None:
                continue
            for z, sign in zip(_both(root.z), (1.0, -1.0), strict=False):
                x, y = _ellipse(z, root.covariance, sign)
                edge = look.line(f"{kind}s", x, y, colour=colour, width=1.0, legend=False)
                edge.merge({"legendgroup": kind, "hoverinfo": "skip"})
                made.add_trace(edge)
    look.label_axes(made, x="real", y=["imaginary"])
    reach = max([1.15, *(abs(root.z) * 1.1 for root in within)])
    reach = min(reach, 3.0)
    made.update_xaxes(range=[-reach, reach])
    made.update_yaxes(range=[-reach, reach], scaleanchor="x")
    made.update_layout(hovermode="closest")
    return made


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
