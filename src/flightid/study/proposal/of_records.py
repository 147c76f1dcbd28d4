"""A study file for rig records: inputs and outputs by column, structures by free run."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flightid.conventions import Light
from flightid.errors import StudyError
from flightid.findings import Finding
from flightid.models.save import toml_value
from flightid.record.time_question import time_said
from flightid.simulation.actuators import check_actuators
from flightid.study.model_settings import placed
from flightid.study.proposal.columns import Columns
from flightid.study.proposal.kept_conditioning import KeptConditioning
from flightid.study.proposal.options import DataOptions, told
from flightid.study.proposal.order_scans import ProposedScans, record_file
from flightid.study.proposal.proposal import Proposal
from flightid.study.proposal.source import read_source
from flightid.study.proposal.stretches import (
    Group,
    Segments,
    Stretch,
    one_experiment,
    segments_of,
    segments_of_equations,
    too_short,
)
from flightid.study.proposal.structures_of import GroupScans, structures_of
from flightid.study.proposal.swept import all_fitted, swept_band, unswept
from flightid.study.proposal.unit_steps import unit_steps
from flightid.study.stage_runner import StageRunner
from flightid.surface import as_key, speaking

POLES = 2
"""Of the model that a loop's rig is advised to begin with."""
SHORTEST = 0.1
"""Part of the longest manoeuvre's samples below which another is a rag between gaps."""


def study_of_records(
    paths: Sequence[Path],
    folder: Path,
    *,
    model: str | None,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    excitations: tuple[str, ...] = (),
    actuators: Mapping[str, float] | None = None,
    reading: DataOptions | None = None,
    conditioning: Sequence[Mapping[str, Any]] = (),
    cache: MutableMapping[str, Any] | None = None,
) -> Proposal:
    """Study file for records.

    Parameters
    ----------
    paths : sequence of Path
        One manoeuvre each, or several.
    folder : Path
        Of the study file.
    model : str or None
        Equations in place of a structure that is looked for.
    inputs, outputs : tuple of str
        Columns, where their names do not tell.
    excitations : tuple of str
        Columns that were injected ahead of a controller: responses are estimated by way of them.
    actuators : mapping of str to float, optional
        Bandwidths, rad/s, of known actuators between columns and the inputs of equations.
    reading : DataOptions, optional
        How the files are read.
    conditioning : sequence of mapping
        Tables ``[[conditioning]]`` of the study; `records` are manoeuvres, ``FILE: MANOEUVRE``.
    cache : mutable mapping of str to object, optional
        Takes the records and scans of the study, so that its run finds them done.

    Raises
    ------
    StudyError
        No column can be told for an input or output, or actuators belong to no equations.
    UnknownNameError, OptionError
        An actuator belongs to no input, or its bandwidth has no meaning.
    """
    equations = None if model is None else placed(folder, model)
    source = read_source(
        paths, reading or DataOptions(), equations, inputs, outputs, excitations
    )  # fmt: skip
    read, columns, injected, renamed = source.parts, source.columns, source.injected, source.renamed
    keys = _keys(source.reading, folder)
    if renamed:
        keys.append(f"columns = {toml_value(renamed)}")
    if injected and model is None:
        raise _needs_equations(paths, columns, injected)
    units, converted = (
        ([], [])
        if model is None
        else unit_steps(model, [part.record for part in read], columns, folder, renamed)
    )
    body = [*units, *_servos(actuators or {}, columns, model, renamed)]
    groups, missed = _groups(read, columns)
    swept = None if model is None else one_experiment(read, columns.inputs, injected)
    if swept is not None:
        groups = [swept[0]]
    runner = StageRunner(cache)
    names: list[str] = []
    together: list[str] = []
    kept = KeptConditioning(tuple(conditioning))
    cut: list[tuple[str, Stretch]] = []
    for whole in groups:
        segments = swept[1] if swept is not None else _segments(whole, model, injected)
        short = too_short(whole, segments) if model is None else None
        if short is not None:
            missed.append(short)
            continue
        group, still = _driven(whole, segments) if swept is None else (whole, [])
        missed += still
        cut += [(name, part) for name, part, _ in segments.all]
        tables = {}
        for name, part, span in segments.all:
            timed = [] if source.reading.time_column else part.time_key()
            tables[name] = [*part.lines(name, span, folder), *keys, *timed]
            body += tables[name]
        fitted, choice = (
            record_file(tables[n], folder) for n in (segments.fitted, segments.choice)
        )
        scans = ProposedScans(
            fitted, choice, group.inputs, columns.outputs, injected, runner, kept.steps(segments)
        )  # fmt: skip
        asked = GroupScans(group, segments, scans)
        if model is not None:
            names.append(Path(model).stem)
            missed += [*unswept(columns.inputs, asked), *all_fitted(asked)]
            body += _equations(model, asked, renamed)
            continue
        found, without = structures_of(asked)
        missed += without
        names += [each.name for each in found]
        body += [line for each in found for line in each.lines]
        together += [said for each in found for said in each.said]
    body += kept.lines(cut)
    with speaking(as_key):
        keyed = _times(read)
    told_of = (*columns.said, *converted, *_times(read), *_stamps(read), *together)
    head = _head(paths, (*columns.said, *converted, *keyed, *_stamps(read), *together), missed)
    return Proposal((*head, *body), tuple(names), tuple(missed), said=told_of)


def _segments(group: Group, model: str | None, injected: tuple[str, ...]) -> Segments:
    """What is fitted, what chooses where no equations are given, and what verifies."""
    return segments_of(group) if model is None else segments_of_equations(group, injected)


def _needs_equations(
    paths: Sequence[Path], columns: Columns, injected: tuple[str, ...]
) -> StudyError:
    """Free runs choose structures, and in a closed loop they favour biased ones."""
    files = " ".join(map(str, paths))
    flags = {"inputs": columns.inputs, "outputs": columns.outputs, "excitation": injected}
    named = " ".join(f"--{name} {','.join(names)}" for name, names in flags.items())
    return StudyError(
        "no structure can be looked for in a closed loop: the noise that comes back to "
        f"{', '.join(columns.inputs)} moves free runs, which would choose a biased one",
        found=f"{', '.join(injected)} injected, and no equations to fit by way of it",
        needed="model='rate_first_order', another of the library, or a file of equations",
        action=f"name it; a PID without one: flightid identify {files} {named} --kind oe "
        f"--method riv --nb {POLES} --nf {POLES} --nk 1 --write model.toml ({POLES} poles, by way "
        "of what was injected; more where it is red), then flightid tune model.toml "
        f"--controller pi_d; the response alone: flightid response {files} {named} --estimator "
        "instrument",
    )


def _servos(
    actuators: Mapping[str, float], columns: Columns, model: str | None, renamed: Mapping[str, str]
) -> list[str]:
    """Actuators that the equations do not hold: taken out ahead of every fit."""
    if not actuators:
        return []
    if model is None:
        raise StudyError(
            "actuators are taken out for a model of equations alone",
            found=", ".join(actuators),
            needed="model='rate_first_order', another of the library, or a file of equations",
            action="leave them out: a structure without equations holds them as well",
        )
    check_actuators(actuators, columns.inputs)
    said = "# Known from the ground; they lie between the columns and the inputs of the model."
    channels = {column: channel for channel, column in renamed.items()}
    known = {channels.get(name, name): each for name, each in actuators.items()}
    return ["", said, "[[conditioning]]", f"actuators = {toml_value(known)}"]


def _times(read: Sequence[Stretch]) -> list[str]:
    """What is to be said of the stamps, in the words of where it is said."""
    return [*filter(None, dict.fromkeys(time_said(part.record) for part in read))]


def _keys(reading: DataOptions, folder: Path) -> list[str]:
    """What every table of the study says of reading, where it is not the usual."""
    keys = told(reading)
    if "join" in keys:
        keys["join"] = [Path(os.path.relpath(file, folder)).as_posix() for file in keys["join"]]
    if "record_column" in keys:
        keys["experiment"] = keys.pop("record_column")
    return [f"{name} = {toml_value(value)}" for name, value in keys.items()]


def _groups(read: Sequence[Stretch], columns: Columns) -> tuple[list[Group], list[Finding]]:
    """Records by the inputs that move in them, the longest of each first."""
    by_inputs: dict[tuple[str, ...], list[Stretch]] = {}
    missed = []
    longest = max(part.record.n_samples for part in read)
    for part in read:
        if part.record.n_samples < SHORTEST * longest:
            missed.append(
                Finding(
                    "short-manoeuvre", Light.AMBER,
                    f"{part.name}: not used, {part.record.n_samples} samples where the longest "
                    f"manoeuvre has {longest}",
                )
            )  # fmt: skip
            continue
        moving = tuple(name for name in columns.inputs if np.ptp(part.record[name]) > 0.0)
        if not moving:
            missed.append(
                Finding(
                    "no-model", Light.RED,
                    f"{part.name}: no model, none of {', '.join(columns.inputs)} moves in it",
                    "record a manoeuvre that moves an input: flightid design plans one",
                )
            )  # fmt: skip
            continue
        by_inputs.setdefault(moving, []).append(part)
    groups = []
    for moving, members in by_inputs.items():
        members.sort(key=lambda each: -each.record.n_samples)
        groups.append(Group(moving, tuple(members)))
    return groups, missed


def _driven(group: Group, segments: Segments) -> tuple[Group, list[Finding]]:
    """The group with the inputs that move in the part that is fitted, and word of the others."""
    record, (start, stop) = group.parts[0].record, segments.spans[0]
    fitted = (record.time_s >= start) & (record.time_s <= stop)
    moving = tuple(name for name in group.inputs if np.ptp(record[name][fitted]) > 0.0)
    still = [name for name in group.inputs if name not in moving]
    if not still or not moving:
        return group, []
    said = f"{segments.fitted}: {', '.join(still)} left out, still from {start:g} to {stop:g} s"
    action = f"record a manoeuvre that moves {' and '.join(still)} early, or name other inputs"
    return replace(group, inputs=moving), [Finding("input-still", Light.AMBER, said, action)]


def _equations(model: str, asked: GroupScans, renamed: Mapping[str, str]) -> list[str]:
    """A model of equations, by way of what was injected where that is known."""
    scans, segments = asked.scans, asked.segments
    template = [f"template = {toml_value(model)}"]
    if not scans.injected:
        template += ['fit = { method = "output_error" }']
    elif (band := swept_band(asked)) is not None:
        said = "# By way of what was injected: a controller in the loop does not bias that."
        names = toml_value(list(scans.injected))
        template += [f"band_rad_s = {toml_value(list(band))}", said]
        template += [f'response = {{ estimator = "instrument", excitations = {names} }}']
    if segments.together or len(scans.injected) > 1:
        # Of inputs times outputs some say nothing: coherence tells which are fitted.
        channels = {column: channel for channel, column in renamed.items()}
        told_outputs = [channels.get(output, output) for output in scans.outputs]
        template += ['responses = "coherent"', f"outputs = {toml_value(told_outputs)}"]
    name = f"name = {toml_value(Path(model).stem)}"
    return ["", "[[model]]", name, *template, *asked.records]


def _stamps(read: Sequence[Stretch]) -> Iterator[str]:
    """Where stamps come from that channels have of their own; by what text of no UTF-8 was read."""
    told = [
        step.options
        for part in read
        for step in part.record.history
        if step.operation == "read_records"
    ]
    yield from (
        f"Stamps of {text}" for text in dict.fromkeys(s.get("stamps") for s in told) if text
    )
    coded = {s.get("file"): s["encoding"] for s in told if s.get("encoding")}
    yield from (f"{file} is no UTF-8: read as {encoding}" for file, encoding in coded.items())


def _head(paths: Sequence[Path], said: Sequence[str], missed: Sequence[Finding]) -> list[str]:
    files = ", ".join(path.name for path in paths)
    return [
        f"# Study of {files}.",
        "# docs/study.md describes every key; `flightid run` of this file gives the same numbers.",
        *(f"# {text}." for text in said),
        *(f"# Left out: {finding.message}." for finding in missed),
        "", "[study]", f"title = {toml_value(f'Models of {paths[0].stem}')}",
        f"aircraft = {toml_value(f'records {files}')}",
        "", "[verify]", "residual_tests = true",
    ]  # fmt: skip
