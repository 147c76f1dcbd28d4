"""Work on gains in a process of its own: tuned as `flightid tune` does, moved as a slider moves."""

from __future__ import annotations

import hashlib
import math
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flightid.app.gain_schemas import (
    AxisGains,
    ControllerForm,
    GainFile,
    GainSlider,
    GainsPart,
    GainStep,
    MarginRow,
    NicholsCurve,
    RefusedGains,
    RigController,
    TimeCurve,
)
from flightid.app.overview import light_of, shown_finding
from flightid.app.study_edits import VIEWS, KeyEdit, edited
from flightid.app.study_reach import draft_inside, named_places
from flightid.app.work import KEPT
from flightid.control.autopilots.parameter_files import parameter_suffix
from flightid.control.tuning.controller_options import ControllerOptions
from flightid.control.tuning.findings import GAINS
from flightid.control.tuning.moved_gains import MovedGains, move_gains
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.result import Tuning
from flightid.conventions import Light
from flightid.errors import DataError, FlightidError, StudyError, UnknownNameError
from flightid.export.gains import write_gains
from flightid.files import write_atomically
from flightid.findings import Finding, worst
from flightid.study.gain_answer import small_angles
from flightid.study.gain_preview import LoopChoice, preview_loops, preview_tuning
from flightid.units import DIMENSIONLESS
from flightid.version import VERSION

MOST_POINTS = 240
"""Of a curve on the page."""
SHOWN_DB = (-40.0, 40.0)
DIGITS = 6
MOST_KEPT = 24
"""Gains of one study, for other presets and values by hand, that are kept; the oldest go."""


def make_gains(study: Path, folder: Path) -> None:
    """Tune a study as it stands, and write what the page shows of that beside older ones."""
    text = study.read_text(encoding="utf-8")
    target = folder / f"gains-{gains_version(study, text)}.json-{VERSION}"
    write_atomically(target, gains_of(study, text).model_dump_json())
    kept = sorted(folder.glob("gains-*"), key=lambda each: -each.lstat().st_mtime_ns)
    for old in kept[MOST_KEPT:]:
        old.unlink(missing_ok=True)


def gains_version(study: Path, text: str) -> str:
    """What the gains of a study rest on: its keys, and the files that it names as they are.

    Raises
    ------
    StudyError
        It names files outside the folder, or cannot be carried out as written.
    """
    with draft_inside(study, text) as draft:
        places = named_places(draft)
    known = [(str(each), *_state(each)) for each in places]
    said = repr((_asked_of_models(text), known))
    return hashlib.sha256(said.encode()).hexdigest()[:16]


def _state(place: Path) -> tuple[int, int]:
    try:
        status = place.stat()
    except OSError:
        return 0, 0
    return status.st_size, status.st_mtime_ns


def gains_of(study: Path, text: str) -> GainsPart:
    """What the page shows of the gains of a study."""
    loops = _loops_of(study, text)
    if loops is not None and not loops.chosen:
        said = "choose the loops to close: models here have several inputs or outputs"
        return GainsPart(
            axes=[], refused=[], findings=[], n_steps=0, left_out={}, refusal=said, files=[],
            loops=list(loops.offered), ranges=dict(loops.ranges), **_asked(text),
        )  # fmt: skip
    tuning = _tuned(study, text)
    by_hand = _hand_gains(text)
    found = tuning
    if by_hand:
        found = _tuned(study, edited(text, [KeyEdit(("tune", "by_hand"), None)]))
    KEPT[plants_key(text)] = tuning
    axes = [
        _axis(each, move_gains(each, {}), _searched(found, each.axis), by_hand)
        for each in tuning.designs
    ]
    single = {finding for each in tuning.designs for finding in each.findings}
    refused = {each.finding for each in tuning.refused}
    refusal = _refusal(tuning)
    return GainsPart(
        axes=axes,
        refused=[
            RefusedGains(axis=r.axis, finding=shown_finding(r.finding)) for r in tuning.refused
        ],
        findings=[shown_finding(f) for f in tuning.findings if f not in single | refused],
        n_steps=max((len(each.stages) for each in tuning.sound), default=0),
        left_out=dict(tuning.left_out),
        refusal=refusal,
        files=[] if refusal else _files(tuning),
        loops=[] if loops is None else list(loops.offered),
        ranges={} if loops is None else dict(loops.ranges),
        **_asked(text),
    )


def _asked(text: str) -> dict[str, str]:
    """Preset and form that a study asks for."""
    table = tomllib.loads(text).get("tune", {})
    usual = {"preset": TuningRequirements().preset, "form": ControllerOptions().controller}
    return {"preset": str(table.get("preset", usual["preset"])),
            "form": str(table.get("controller", usual["form"]))}  # fmt: skip


def _loops_of(study: Path, text: str) -> LoopChoice | None:
    """Loops of a study of records; None where an autopilot has its own."""
    with draft_inside(study, text) as draft:
        return preview_loops(draft, cache=KEPT)


def move_axis(
    study: Path,
    text: str,
    edits: Sequence[KeyEdit],
    axis: str,
    values: Mapping[str, float],
    responses: bool = True,
) -> Mapping[str, Any]:
    """One axis with other gains, judged by the plants that are kept."""
    whole = edited(text, edits) if edits else text
    tuning = hold_plants(study, whole)
    for design in tuning.designs:
        if design.axis == axis:
            moved = move_gains(design, values, responses=responses)
            return _axis(design, moved, {}, values).model_dump()
    raise UnknownNameError(
        "no gains of this axis", found=axis, needed=", ".join(d.axis for d in tuning.designs)
    )


def hold_plants(study: Path, text: str) -> Tuning:
    """Plants of a study as this process keeps them; worked out where it does not yet."""
    key = plants_key(text)
    tuning = KEPT.get(key) or _tuned(study, text)
    KEPT[key] = tuning
    return tuning


def prepare_plants(study: Path, text: str) -> None:
    """Have the plants ready for the first slider that is moved."""
    hold_plants(study, text)


def make_files(study: Path, text: str) -> list[dict[str, str]]:
    """The files of ``flightid tune --write``: every step, each with its way back."""
    tuning = _tuned(study, text)
    if refusal := _refusal(tuning):
        raise DataError(refusal)
    return [each.model_dump() for each in _files(tuning)]


def _files(tuning: Tuning) -> list[GainFile]:
    """Parameter files of an autopilot; of a PID numbers, and code where it has a rate."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        written = write_gains(tuning, folder / f"gains{_suffix(tuning)}")
        if tuning.plain and all(each.plain.sampled for each in tuning.sound if each.plain):
            written += write_gains(tuning, folder / "gains.c")
        return [GainFile(name=each.name, text=each.read_text(encoding="utf-8")) for each in written]


def _suffix(tuning: Tuning) -> str:
    return ".toml" if tuning.plain else parameter_suffix(tuning.designs[0].flown.autopilot)


def _tuned(study: Path, text: str) -> Tuning:
    with draft_inside(study, text) as draft:
        made = preview_tuning(draft, cache=KEPT)
    if made is None:
        raise StudyError(
            "no model of this study can be tuned", needed="a model of a rate to its command"
        )
    return made


def _hand_gains(text: str) -> Mapping[str, float]:
    given = tomllib.loads(text).get("tune", {}).get("by_hand")
    return given if isinstance(given, dict) else {}


def plants_key(text: str) -> str:
    """What plants rest on: all of the study but the gains by hand.

    What nobody has said is as it is where it is said: the first click writes that too.
    """
    document = _asked_of_models(text)
    table = document.get("tune", {})
    if isinstance(table, dict):
        said = {key: value for key, value in table.items() if key != "by_hand"}
        usual = _asked(text)
        if "log" in document:
            del usual["form"]  # an autopilot's own, where none is named
        document["tune"] = {
            "preset": usual["preset"], "controller": usual.get("form"), **said
        }  # fmt: skip
    return "tuning of " + hashlib.sha256(repr(document).encode()).hexdigest()


def _asked_of_models(text: str) -> dict[str, Any]:
    """A study without what is asked of its log alone."""
    return {key: value for key, value in tomllib.loads(text).items() if key not in VIEWS}


def _searched(tuning: Tuning, axis: str) -> Mapping[str, float]:
    for design in tuning.designs:
        if design.axis == axis and design.exists:
            return design.gains
    return {}


def _refusal(tuning: Tuning) -> str:
    """What keeps gains from being written, what to do stands with it as a verdict; else empty."""
    try:
        tuning.writable()
    except FlightidError as error:
        return str(error.found or error.problem)
    return ""


def _axis(
    design: PidDesign,
    moved: MovedGains,
    found: Mapping[str, float],
    by_hand: Mapping[str, float],
) -> AxisGains:
    hand = any(name in by_hand or f"{design.axis}/{name}" in by_hand for name in design.gains)
    findings = tuple(moved.finding if each.code in GAINS else each for each in design.findings)
    return AxisGains(
        axis=design.axis,
        by_hand=hand,
        light=light_of(worst(findings)),
        sentence=_sentence(moved),
        is_stable=moved.is_stable,
        sliders=[
            GainSlider(
                name=each.name,
                unit=each.unit,
                flown=each.flown,
                found=found.get(each.name),
                value=moved.values[each.name],
                low=each.ends[0],
                high=each.ends[1],
            )
            for each in design.changes
        ],
        margins=_margins(moved),
        curves=_curves(moved),
        loops=_loops(moved),
        steps=[
            GainStep(
                gains=dict(each.gains),
                stable=each.stable,
                phase_margin_deg=each.phase_margin_deg,
                gain_margin_db=each.gain_margin_db,
            )
            for each in design.stages
        ],
        filters=[f"{each.name} {each.old:g} to {each.value:g}" for each in design.filters],
        findings=[shown_finding(each) for each in (*findings, *_small_moves(design))],
        controller=_controller(design),
    )


def _sentence(moved: MovedGains) -> str:
    count, total = int(moved.met.sum()), len(moved.met)
    if moved.unstable:
        return f"unstable for {moved.unstable} of {total} plants that the data allow"
    said = f"{count} of {total} plants that the data allow meet every requirement"
    return said + (f"; not met: {', '.join(moved.short)}" if moved.short else "")


def _small_moves(design: PidDesign) -> list[Finding]:
    """Up to which error its angle steps hold, as the command says below its gains."""
    return [Finding("small-angles", Light.GREEN, each, "") for each in small_angles([design])]


def _controller(design: PidDesign) -> RigController | None:
    loop = design.plain
    if loop is None:
        return None
    table = loop.form_table()
    forms = [ControllerForm(name=str(a), law=str(b), gains=str(c)) for a, b, c in table.rows]
    measured, moved = ("" if each == DIMENSIONLESS else each for each in loop.units or ("", ""))
    return RigController(
        forms=forms, remarks=list(table.notes), sampled=loop.sampled, measured=measured,
        moved=moved,
    )  # fmt: skip


def _margins(moved: MovedGains) -> list[MarginRow]:
    rows = []
    for each in moved.worst_cases:
        ends = each.estimate.interval(0.95)
        low, high = ends or (None, None)
        rows.append(
            MarginRow(
                loop=each.loop,
                name=each.name,
                unit=each.unit,
                required=each.required,
                met=each.met,
                digits=each.digits,
                nominal=each.nominal,
                low=low,
                high=high,
                worst=each.shown_worst[0],
                flown=each.flown,
                flown_worst=each.shown_worst[1],
                untold="" if each.worst is not None else each.estimate.reason,
                missed=each.shown_missed,
                n_missed=each.n_missed,
                n_plants=each.n_plants,
            )
        )
    return rows


def _curves(moved: MovedGains) -> list[TimeCurve]:
    made = []
    for each in moved.responses:
        rows = slice(None, None, max(1, -(-len(each.time_s) // MOST_POINTS)))
        made.append(
            TimeCurve(
                name=each.name,
                unit=each.unit,
                time_s=_plain(each.time_s[rows]),
                estimate=_plain(each.estimate[rows]),
                low=_plain(each.low[rows]),
                high=_plain(each.high[rows]),
                flown=None if each.flown is None else _plain(each.flown[rows]),
            )
        )
    return made


def _loops(moved: MovedGains) -> list[NicholsCurve]:
    made = []
    for name, values in moved.loops.items():
        gain = 20.0 * np.log10(np.maximum(np.abs(values), 1e-9))
        phase = np.degrees(np.unwrap(np.angle(values)))
        # The branch in which the loop crosses 0 dB about −180°.
        cross = int(np.argmin(np.abs(gain)))
        phase -= 360.0 * math.ceil((phase[cross] - 0.0) / 360.0)
        kept = np.flatnonzero((gain >= SHOWN_DB[0]) & (gain <= SHOWN_DB[1]))
        kept = kept[:: max(1, -(-len(kept) // MOST_POINTS))]
        made.append(
            NicholsCurve(name=name, phase_deg=_plain(phase[kept]), gain_db=_plain(gain[kept]))
        )
    return made


def _plain(values: np.ndarray) -> list[float]:
    return [float(f"{each:.{DIGITS}g}") for each in values.tolist()]
