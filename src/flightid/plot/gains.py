"""What new gains promise, all axes in one picture: steps, and margins against requirements."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.control.margins.mode_slack import TAKEN
from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.modes_outside import BELOW_BAND
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.responses import ResponseBand
from flightid.control.tuning.unpromised import outside_words
from flightid.control.tuning.worst_cases import WorstCase
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.flight import COLOURS
from flightid.plot.record import sparse
from flightid.review import FlightReview, LoopResponse

STEPS = {
    "rate step": "rate per set-point",
    "angle step": "angle per set-point",
    "step": "output per set-point",
}
PANELS = {"phase margin": "deg", "gain margin": "dB"}
ROW_PX = 26
TITLE_PX = 22


def overlaid_steps(designs: Sequence[PidDesign]) -> go.PlotFigure:
    """Draw the steps of all axes over each other: new gains with the extremes of all plants, flown.

    Parameters
    ----------
    designs : sequence of PidDesign
        Of one flight.

    Returns
    -------
    PlotFigure
    """
    told = {each.name for design in designs for each in design.responses}
    names = [name for name in STEPS if name in told]
    titles = [STEPS[name] for name in names]
    # Above their plots: beside them a phone lays the second on the first plot.
    made = look.figure(1, len(names), column_titles=titles, shared_x=False, height_px=350)
    made.update_layout(legend={"y": 1.0 + TITLE_PX / (made.layout["height"] - 110)})
    made.update_layout(margin={"t": 60})
    for title in made.layout["annotations"]:
        title["font"] = {"size": 13}
    for place, design in enumerate(designs):
        colour = COLOURS.get(design.axis, look.SERIES[place % len(look.SERIES)])
        for column, name in enumerate(names, 1):
            found = next((each for each in design.responses if each.name == name), None)
            if found is None:
                continue
            label = design.axis if len(designs) > 1 else "new gains"
            few = sparse(found.time_s.size)
            time_s, low, high = (each[few] for each in (found.time_s, found.low, found.high))
            made.add_traces(look.band(label, time_s, low, high, colour=colour), 1, column)
            curves = [(label, found.estimate, "solid")]
            if found.flown is not None:
                curves.append((f"{design.axis} as flown", found.flown, "dash"))
            for words, values, dash in curves:
                drawn = look.line(
                    words, time_s, values[few], colour=colour, dash=dash, legend=column == 1
                )
                made.add_trace(drawn, 1, column)
    for column in range(1, len(names) + 1):
        look.label_axes(made, x="time [s]", y=[""], column=column)
    return made


def steps_caption(designs: Sequence[PidDesign]) -> str:
    """What `overlaid_steps` shows, by what there is."""
    curves = [each for design in designs for each in design.responses if each.name in STEPS]
    flown = any(each.flown is not None for each in curves)
    shaded = any((each.high > each.low).any() for each in curves)
    parts = [
        "Steps with the new gains" + (", dashed as flown" if flown else ""),
        *(["shaded: all that the data allow"] if shaded else []),
    ]
    return "; ".join(parts) + "."


def promised_margins(designs: Sequence[PidDesign]) -> go.PlotFigure:
    """Draw the margins of the worst vehicle as bars, with what was required and what was flown.

    Parameters
    ----------
    designs : sequence of PidDesign

    Returns
    -------
    PlotFigure
    """
    asked = designs[0].requirements
    panels = PANELS
    found = {
        name: [
            (design, each) for design in designs for each in design.worst_cases if each.name == name
        ]
        for name in panels
    }
    rows = list(dict.fromkeys(_label(*each) for cases in found.values() for each in cases))
    # A panel without a bar took half of the picture, on a phone a screen: its caption says it.
    panels = {name: unit for name, unit in panels.items() if _is_promised(found[name])} or panels
    what = _what(designs)
    made = look.figure(
        1, len(panels), shared_x=False, height_px=look.MARGIN_PX + ROW_PX * len(rows)
    )
    named: set[str] = set()
    for column, (name, unit) in enumerate(panels.items(), 1):
        cases = [each for each in found[name] if each[1].worst is not None]
        required = [
            (asked.angle_phase_margin_deg if each.loop == ANGLE else asked.phase_margin_deg)
            if name == "phase margin"
            else asked.gain_margin_db
            for _, each in cases
        ]
        labels = [_label(*each) for each in cases]
        if not cases:
            unread = [each for _, each in found[name] if each.estimate.value is not None]
            _say_without_limit(made, name, column, rows, unread)
            continue
        bars = go.Bar(
            x=[each.worst for _, each in cases], y=labels, orientation="h", width=0.6,
            name=f"worst {what}, new gains", showlegend=column == 1, legendgroup="new",
            marker={"color": [look.MODEL if each.met else look.RIVAL for _, each in cases]},
            text=[f"{each.shown_worst[0]:.{each.digits}g}" for _, each in cases],
            textposition="inside", insidetextanchor="start",
        )  # fmt: skip
        made.add_trace(bars, 1, column)
        flown = [
            (label, each.flown_worst)
            for label, (_, each) in zip(labels, cases, strict=True)
            if each.flown_worst is not None
        ]
        upright = {"color": look.BLACK, "symbol": "line-ns-open", "size": 18,
                   "line": {"width": 3, "color": look.BLACK}}  # fmt: skip
        open_circle = {
            "color": look.RIVAL,
            "symbol": "circle-open",
            "size": 9,
            "line": {"width": 2},
        }
        for words, marker, points in (
            (f"worst {what}, flown gains", open_circle, flown),
            ("required", upright, list(zip(labels, required, strict=True))),
        ):
            if not points:
                continue
            drawn = go.Scatter(
                x=[value for _, value in points], y=[label for label, _ in points], name=words,
                mode="markers", marker=marker, legendgroup=words, showlegend=words not in named,
            )  # fmt: skip
            named.add(words)
            made.add_trace(drawn, 1, column)
        _say_what_is_not_promised(made, column, [row for row in rows if row not in labels])
        made.update_xaxes(
            title_text=look.axis_title(name, unit), rangemode="tozero", row=1, col=column
        )
    made.update_yaxes(
        categoryorder="array", categoryarray=rows[::-1], automargin=True, type="category",
        range=[-0.5, len(rows) - 0.5],
    )  # fmt: skip
    if len(panels) > 1:
        made.update_yaxes(showticklabels=False, col=2)
    made.update_layout(hovermode="closest")
    return made


def margins_caption(designs: Sequence[PidDesign]) -> str:
    """What `promised_margins` shows, and which margin is promised of no loop."""
    cases = [each for design in designs for each in design.worst_cases]
    named = {name: [each for each in cases if each.name == name] for name in PANELS}
    parts = [
        f"Margins of the worst {_what(designs)} that the data allow; upright: what was required"
    ]
    shown = [each for each in cases if each.name in PANELS]
    unread = (e for e in shown if e.worst is None and e.estimate.value is not None)
    above = any(each.estimate.reason not in (BELOW_BAND, TAKEN["below"]) for each in unread)
    if outside := outside_words(shown, above=above):
        parts.append(f"not promised: {outside}")
    bare = [name for name in named if not any(each.worst is not None for each in named[name])]
    if len(bare) < len(PANELS):
        parts += [_without_bars(name, named[name], what=_what(designs)) for name in bare]
    return "; ".join(parts) + "."


def _what(designs: Sequence[PidDesign]) -> str:
    return "rig" if any(design.plain for design in designs) else "vehicle"


def _is_promised(cases: Sequence[tuple[PidDesign, WorstCase]]) -> bool:
    return any(each.worst is not None for _, each in cases)


def _without_bars(
    name: str, cases: Sequence[WorstCase], line: str = " ", what: str = "vehicle"
) -> str:
    """Why a margin has no bar; `line` stands before what the estimate alone has of it."""
    values = [each.estimate.value for each in cases if each.estimate.value is not None]
    if not values:
        return f"no {what}'s loop has a finite {name}"
    ends = dict.fromkeys(f"{value:.3g}" for value in (min(values), max(values)))
    unit = next(each.unit for each in cases if each.estimate.value is not None)
    return f"no {name} is promised{line}({' to '.join(ends)} {unit} of the estimate alone)"


def _say_what_is_not_promised(made: go.PlotFigure, column: int, rows: Sequence[str]) -> None:
    """Words in place of a bar, where a margin is read outside the band of the model."""
    if rows:
        words = go.Scatter(
            x=[0.0] * len(rows), y=list(rows), mode="text", text=[" not promised"] * len(rows),
            textposition="middle right", textfont={"size": 11}, opacity=0.7,
            showlegend=False, hoverinfo="skip", name="not promised",
        )  # fmt: skip
        made.add_trace(words, 1, column)


def _say_without_limit(
    made: go.PlotFigure, name: str, column: int, rows: Sequence[str], unread: Sequence[WorstCase]
) -> None:
    """A panel without a bar says why; an axis without a trace has no place.

    `unread` are loops whose estimate has this margin, which is not promised for every vehicle.
    """
    said = _without_bars(name, unread, "<br>")
    unseen = go.Scatter(
        x=[0.0] * len(rows), y=list(rows), mode="markers", showlegend=False, hoverinfo="skip",
        name=name, marker={"opacity": 0.0},
    )  # fmt: skip
    made.add_trace(unseen, 1, column)
    made.add_annotation(1, column, text=said, x=0.5, y=0.5, showarrow=False)
    ends = {f"{axis}ref": f"{axis}{column if column > 1 else ''} domain" for axis in "xy"}
    made.layout["annotations"][-1].merge(ends)
    made.update_xaxes(
        title_text=look.axis_title(name, "dB" if column > 1 else "deg"), showticklabels=False,
        range=[0.0, 1.0], row=1, col=column,
    )  # fmt: skip


def has_both(review: FlightReview, designs: Sequence[PidDesign]) -> bool:
    """Whether a rate loop is both measured and predicted with the gains that flew."""
    return bool(_both(review, designs))


def measured_and_predicted(review: FlightReview, designs: Sequence[PidDesign]) -> go.PlotFigure:
    """Draw steps of rate set-points as the flight has them, and as models do with its gains.

    Parameters
    ----------
    review : FlightReview
    designs : sequence of PidDesign
        Made of the same flight.

    Returns
    -------
    PlotFigure
    """
    pairs = _both(review, designs)
    made = look.figure(1, len(pairs), shared_x=False, height_px=330)
    for column, (loop, predicted) in enumerate(pairs, 1):
        kept = loop.time_s <= predicted.time_s[-1]
        time_s, edges = loop.time_s[kept], [edge[kept] for edge in loop.band()]
        made.add_traces(look.band("measured", time_s, *edges, colour=look.BLACK), 1, column)
        shown, few = column == 1, sparse(predicted.time_s.size)
        assert predicted.flown is not None
        for words, when, values, colour, dash in (
            ("measured", time_s, loop.step[kept], look.BLACK, "solid"),
            ("model", predicted.time_s[few], predicted.flown[few], look.MODEL, "dash"),
        ):
            drawn = look.line(words, when, values, colour=colour, dash=dash, legend=shown)
            made.add_trace(drawn, 1, column)
        title = f"{loop.axis} rate per set-point"
        look.label_axes(made, x="time [s]", y=[title], column=column)
        made.update_xaxes(range=[0.0, float(time_s[-1])], row=1, col=column)
    return made


def _both(
    review: FlightReview, designs: Sequence[PidDesign]
) -> list[tuple[LoopResponse, ResponseBand]]:
    predicted = {
        design.axis: each
        for design in designs
        for each in design.responses
        if each.name == "rate step" and each.flown is not None
    }
    return [
        (loop, predicted[loop.axis])
        for loop in review.loops
        if loop.loop == "rate" and loop.is_told and loop.axis in predicted
    ]


def _label(design: PidDesign, case: WorstCase) -> str:
    return f"{design.axis}, {case.loop}"
