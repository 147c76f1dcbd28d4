"""What a study has to say, as a content tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding, unsaid
from flightid.options import Options
from flightid.plot.consistency import consistency
from flightid.plot.fit import EstimateBar, parameter_intervals
from flightid.plot.gains import (
    has_both,
    margins_caption,
    measured_and_predicted,
    overlaid_steps,
    promised_margins,
    steps_caption,
)
from flightid.plot.glance import flight_glance, has_glance
from flightid.report.blocks import provenance, result_blocks
from flightid.report.closed_loop import closed_loop_section
from flightid.report.content import Block, Document, Figure, Lights, Paragraph, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.report.flight import flight_blocks
from flightid.report.handling_qualities import handling_qualities_blocks
from flightid.report.tuning import gain_flight_blocks, tuning_section
from flightid.report.verification import prediction_picture
from flightid.study.answer import answer_of, models_in_short
from flightid.study.elsewhere import BESIDE, red_elsewhere
from flightid.study.estimate_tables import model_table
from flightid.study.faults import other_faults, section_of, whole_section
from flightid.study.model_section import model_section
from flightid.study.results import StudyResults
from flightid.study.truth import inside, recovered
from flightid.study.tuning import AUTOPILOT_ONLY
from flightid.study.views import view_sections
from flightid.table import Cell, Column, Table
from flightid.uncertainty.quantiles import interval_words, shown
from flightid.version import VERSION

if TYPE_CHECKING:
    from flightid.conditioning.consistency_result import KinematicConsistency
    from flightid.record import Record
    from flightid.review import FlightReview
    from flightid.study.identified import ModelResults
    from flightid.uncertainty.estimate import Estimate


FEW_RECORDS = 4
"""Records whose histories are open."""
MANY = 20
"""Intervals above which their picture opens on demand."""


def study_document(study: StudyResults) -> Document:
    """Say what a study found.

    Parameters
    ----------
    study : StudyResults
        Results of all stages.
    """
    settings = study.settings
    sections = (
        *(
            section_of(f"Data compatibility of “{name}”", _consistency, found)
            for name, found in study.consistency.items()
        ),
        *(model_section(item, study.truth) for item in study.identified),
        *_qualities(study),
        *_uses(study),
        section_of("The records" if study.inspection is None else "The log", _source_blocks, study),
        *_review(study),
        *view_sections(study.tried, study.plots, study.plan),
        Section("Provenance", provenance(study.files, _options(study))),
    )
    return Document(
        settings.title,
        settings.aircraft,
        (section_of("Result", partial(_result, sections=sections), study), *sections),
        f"Made by flightid {VERSION} from {', '.join(study.files)}.",
    )


def _consistency(found: KinematicConsistency) -> Iterator[Block]:
    yield from result_blocks(found, title="Instrument errors")
    yield TableBlock(found.fits())
    shown = "Outputs as measured, and rebuilt from rates and accelerations with these errors."
    yield figure_block(consistency(found), shown)


def _uses(study: StudyResults) -> Iterator[Section]:
    """What was made with the models, where the study asks for it."""
    uses = study.uses
    if uses.conditions is not None:
        yield section_of("Flight conditions", result_blocks, uses.conditions)
    if uses.rotor is not None:
        yield section_of("Rotor physics", result_blocks, uses.rotor)
    for asked, closed in uses.loops:
        made = partial(closed_loop_section, closed, band_rad_s=asked.band_rad_s)
        yield whole_section(closed.name, made)
    if uses.files:
        rows = tuple((name, file) for name, file in uses.files.items())
        table = Table(
            "Models, with covariance and evidence", (Column("model"), Column("file")), rows
        )
        exported = (TableBlock(each.summary()) for each in uses.exported)
        yield Section("Files", (TableBlock(table), *exported))
    if study.tuning is not None:
        yield whole_section("Gains", tuning_section, study.tuning)
    if study.gain_flight is not None:
        yield section_of("Gains flown again", gain_flight_blocks, study.gain_flight)


def _qualities(study: StudyResults) -> Iterator[Section]:
    if study.qualities:
        parts = (
            section_of(
                f"Handling qualities of “{name}”",
                partial(handling_qualities_blocks, folded=name.endswith(BESIDE)),
                found,
            )
            for name, found in study.qualities.items()
        )
        yield Section("Handling qualities", (), tuple(parts))


def parameter_table(study: StudyResults) -> Table:
    """All parameters with their intervals, and with the truth where it is known.

    Parameters
    ----------
    study : StudyResults
        Results of all stages.
    """
    words = interval_words(shown())
    columns = [
        Column("model"),
        Column("parameter"),
        Column("value", digits=5),
        Column("unit"),
        Column(f"{words} low"),
        Column(f"{words} high"),
    ]
    beside = _beside(study)
    if beside:
        columns += [Column(beside, digits=5), Column("inside")]
    rows: list[tuple[Cell, ...]] = []
    for item, parameter, true_value in _parameters(study):
        low, high = parameter.interval(shown()) or (None, None)
        row: list[Cell] = [item.settings.name, parameter.name, parameter.value, parameter.unit]
        row += [low, high]
        if beside:
            row += [true_value, inside(parameter, true_value, _dropped(item))]
        rows.append((*row, _meaning(item, parameter.name)))
    columns.append(Column("meaning"))
    notes = () if study.truth is None else ("Truth: what the simulated vehicle obeys at hover.",)
    return Table("Parameters", tuple(columns), tuple(rows), notes).without_empty_columns()


def _meaning(item: ModelResults, name: str) -> str:
    """What a parameter is, in the words of its model."""
    known = getattr(None if item.fit is None else item.fit.model, "parameters", {})
    found = known.get(name) if isinstance(known, Mapping) else None
    return getattr(found, "note", "") or ""


def _dropped(item: ModelResults) -> Mapping[str, float]:
    """What a reduction has fixed, and at which value."""
    return {} if item.reduction is None else item.reduction.dropped


def _beside(study: StudyResults) -> str:
    """What stands beside the estimates: a reference, a simulated flight's truth, or nothing."""
    if any(item.reference is not None for item in study.identified):
        return "reference"
    return "" if study.truth is None else "truth"


def _parameters(study: StudyResults) -> Iterator[tuple[ModelResults, Estimate, float | None]]:
    for item in study.identified:
        if item.fit is None or item.settings.structure is not None:
            continue
        truth = {} if study.truth is None else study.truth.parameters(item.fit.model)
        if item.reference is not None:
            truth = {
                name: p.value
                for name, p in item.reference.parameters.items()
                if p.value is not None
            }
        for name, parameter in item.fit.parameters.items():
            yield item, parameter, truth.get(name)


def _result(study: StudyResults, *, sections: tuple[Section, ...] = ()) -> Iterator[Block]:
    answer = answer_of(study)
    red = red_elsewhere(answer.findings, sections)
    # Gains that could not be made stand nowhere else: they count.
    own = tuple(each for each in answer.findings if study.tuning is None and each.code == "gains")
    told = (*(each for each in answer.findings if each not in own), *red)
    yield Lights(told, repeats=True)
    if own:
        yield Lights(own)
    # The promise stands in a picture: its table opens on demand.
    pictures, promises = _pictures(study), answer.tables[1:]
    yield from islice(pictures, 1)
    yield from map(TableBlock, answer.tables[:1])
    yield from pictures
    yield from (TableBlock(table, folded=True) for table in promises)
    if study.settings.notes:
        yield Paragraph(study.settings.notes)
    if others := other_faults(study.faults):
        yield Lights(others)
    yield models_in_short(study.identified)
    # A tied parameter follows another: it would count the same miss twice.
    held = [
        inside(parameter, true, _dropped(item))
        for item, parameter, true in _parameters(study)
        if parameter.status != "tied"
    ]
    judged = np.array([value for value in held if value is not None], dtype=bool)
    if judged.size:
        yield Lights((recovered(judged),))
    if len(study.identified) > 1 or not study.has_equations:
        yield TableBlock(model_table(study.identified))
    if study.has_equations:
        yield TableBlock(parameter_table(study))
    yield from _interval_figure(study)


def _pictures(study: StudyResults) -> Iterator[Figure]:
    """What new gains do and promise, of all axes; without gains, what a model predicts."""
    designs = () if study.tuning is None else study.tuning.designs
    made = [each for each in designs if each.exists]
    if made:
        yield figure_block(overlaid_steps(made), steps_caption(made))
        yield figure_block(promised_margins(made), margins_caption(made))
        return
    checked = [found for item in study.identified for found in item.verifications.values()]
    yield from (prediction_picture(found, 0) for found in checked[:1])


def _review(study: StudyResults) -> Iterator[Section]:
    """What the flight tells besides its models; its verdicts are not those of the models."""
    if study.review is not None:
        yield section_of("The flight", _flight, study, study.review)


def _flight(study: StudyResults, review: FlightReview) -> Iterator[Block]:
    if has_glance(review):
        shown = "Throttle with the modes, shaded in the air; below it what the models were made of."
        yield figure_block(flight_glance(review, _used(study)), shown)
    designs = () if study.tuning is None else study.tuning.designs
    if has_both(review, designs):
        shown = (
            "Steps of rate set-points with the flown gains: measured in ordinary flying with its "
            "band, and dashed as the identified models have it."
        )
        yield figure_block(measured_and_predicted(review, designs), shown)
    # What the inspection says of the same log stands in its own section.
    said = () if study.inspection is None else study.inspection.findings
    alone = replace(review, findings=tuple(unsaid(review.findings, said)))
    yield from flight_blocks(alone, repeats=True, glance=False)


def _used(study: StudyResults) -> dict[str, list[tuple[Record, Sequence[str]]]]:
    """Records of the log by the model that they made."""
    return {
        item.name: [
            (record, [each for each in channels if each in record.channels])
            for channels in [(*item.fit.model.inputs, *item.fit.model.outputs)]
            for name in item.settings.identify
            for record in [study.records.get(name)]
            if record is not None
        ]
        for item in study.identified
        if item.fit is not None
    }


def _source_blocks(study: StudyResults) -> Iterator[Block]:
    declared = tuple(
        Finding(
            "unit-declared",
            Light.AMBER,
            f"record {name}, channel {channel.name}: {channel.note}",
            "see that the file is wrong, and not the study",
        )
        for name, record in study.records.items()
        for channel in record.channels.values()
        if channel.is_declared
    )
    if declared:
        yield Lights(declared)
    if study.inspection is None:
        yield TableBlock(_record_table(study), folded=len(study.records) > FEW_RECORDS)
        return
    yield Lights(study.inspection.findings)
    first, *others = study.inspection.tables()[1:]
    yield TableBlock(first)
    yield from (TableBlock(table, folded=True) for table in others)
    yield TableBlock(_record_table(study), folded=True)


def _record_table(study: StudyResults) -> Table:
    columns = (
        Column("record"),
        Column("from", "s", 6),
        Column("to", "s", 6),
        Column("rate", "Hz"),
        Column("samples"),
        Column("channels"),
        Column("made by"),
    )
    rows = tuple(
        (
            name,
            float(record.time_s[0]),
            float(record.time_s[-1]),
            record.sample_rate_hz,
            record.n_samples,
            ", ".join(record.channels),
            "; ".join(map(str, record.history)),
        )
        for name, record in study.records.items()
    )
    title = "Records" if study.inspection is None else "Records cut from the log"
    return Table(title, columns, rows)


def _interval_figure(study: StudyResults) -> tuple[Figure, ...]:
    estimates = [
        EstimateBar(f"{parameter.name}, {item.settings.name}", parameter.value, low, high, true)
        for item, parameter, true in _parameters(study)
        if (ends := parameter.interval(shown())) is not None
        for low, high in [ends]
    ]
    if not estimates:
        return ()
    reference = _beside(study) or "estimate"
    caption = (
        f"Estimates with their {interval_words(shown())} intervals, in percent of the {reference}."
    )
    if any(bar.truth == 0.0 for bar in estimates):
        caption += " Where that is zero, in percent of the estimate."
    many = len(estimates) > MANY
    return (figure_block(parameter_intervals(estimates), caption, folded=many),)


def _options(study: StudyResults) -> dict[str, Cell]:
    settings, response = study.settings, study.settings.response
    if not settings.models:
        return {}
    methods = dict.fromkeys(model.fit.method for model in settings.models)
    options: dict[str, Cell] = {"fit": ", ".join(methods)}
    if any(item.responses for item in study.identified):
        options |= _told("response", response)
    options |= {f"{name} of a fit": str(value) for name, value in settings.fit.options.items()}
    options |= _told("verification", settings.check)
    if settings.tune is not None:
        options |= _told("tuning", settings.tune.requirements)
        own = settings.tune.controller
        told = _told("tuning", settings.tune.options)
        if own is not None:
            unknown = [f"{name} of the tuning" for name in AUTOPILOT_ONLY]
            told = {name: value for name, value in told.items() if name not in unknown}
            told |= _told("controller", own)
        options |= told
    if settings.fly is not None:
        options |= _told("flight with new gains", settings.fly)
    if settings.reduce is not None:
        options |= {
            name.replace("_", " "): value for name, value in vars(settings.reduce.limits).items()
        }
        options["after a marked rise"] = settings.reduce.after_rise
    if settings.flight is not None and study.truth is not None:
        options["seed of the flight"] = settings.flight.seed
    return options


def _told(owner: str, options: Options) -> dict[str, Cell]:
    """Options by name, without those that nobody set and that have no number by default."""
    return {
        f"{name} of the {owner}": str(value)
        for name, value in options.to_dict().items()
        if value not in (None, [], {})
    }
