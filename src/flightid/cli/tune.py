"""``flightid tune``: gains of an autopilot from a log, a study or models."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.hints import PARAMETERS
from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import (
    WRITTEN,
    Exit,
    emit_values,
    json_option,
    leave_by_verdict,
    level_option,
    note,
)
from flightid.cli.proposals import answer_text, is_study, of_data, show_answer, taken_study
from flightid.cli.records import FILES, FilesArgument
from flightid.errors import OptionError

if TYPE_CHECKING:
    from flightid.control.tuning.result import Tuning
    from flightid.findings import Finding
    from flightid.options import Options
    from flightid.study import Study
    from flightid.study.tuning import TuneSettings


USUAL = "pi_d"
"""Controller of records where none is named."""


def _fields() -> dict[str, type[Options]]:
    from flightid.control.tuning.controller_options import ControllerOptions
    from flightid.control.tuning.options import TuneOptions
    from flightid.control.tuning.requirements import TuningRequirements

    # As `flightid.study.tuning.KINDS` has them, which brings all that a run needs with it.
    return {
        "requirements": TuningRequirements,
        "tuning": TuneOptions,
        "a controller": ControllerOptions,
    } | of_data()


@click.command(cls=OptionsCommand, fields_of=_fields)
@click.argument(
    "files",
    nargs=-1,
    required=True,
    metavar="LOG | RECORDS... | STUDY | MODEL... | FLEET",
    type=click.Path(exists=True, path_type=Path),
    cls=FilesArgument,
)
@click.option(
    "--log",
    type=FILES,
    help="Log to read instead of the one that the study names; of models: their flight.",
)
@click.option(
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder of the study's results; default: <study>-output beside the study file.",
)
@click.option(
    "--write",
    "target",
    type=WRITTEN,
    help="Parameter file to write, for example gains.param; every step with its way back.",
)
@click.option(
    "--type",
    "type_name",
    help="Of a fleet: vehicle type whose models are pooled; default: the only one.",
)
@click.option(
    "--joint-fit",
    is_flag=True,
    help="Of a fleet: fit the responses of all flights together, in place of pooling their fits.",
)
@click.option("--overwrite", is_flag=True, help="Replace parameter files that exist.")
@click.option("--all", "whole", is_flag=True, help="Print every table, not one screen of them.")
@level_option
@json_option
def command(
    files: tuple[Path, ...],
    log: Path | None,
    output: Path | None,
    target: Path | None,
    type_name: str | None,
    joint_fit: bool,
    overwrite: bool,
    whole: bool,
    level: float | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Tune the autopilot that LOG was flown with: from the log, a STUDY, fitted MODELs or a FLEET.

    Of a LOG, or of RECORDS of a rig, the study that they ask for is written beside the results
    first, as `flightid run` does.

    RECORDS hold no gains of an autopilot: their gains are those of a PID of its own around each
    loop, pi_d unless --controller names another, of models too where it is given; --write takes
    gains.toml then, or gains.c for code.

    A MODEL is a .toml file, the JSON of a fit, or the output folder of a study, all models of which
    are taken. A FLEET is a fleet file or the folder of its catalogue: its models are pooled
    over all vehicles of a type, and the gains hold for the next one. The table [tune] of the
    study holds requirements and options; what is given here goes before it, and without either
    the usual ones apply. Gains keep their margins for every plant that the data allow. An axis
    that its data do not allow, or whose gains have a red verdict, is refused by name and left
    out of the files, which say so; axes that one model couples are written together or not at
    all. The exit code is then 1. --accept-red writes all that there is.
    """
    from flightid.study.tuning import TuneSettings

    if target is not None and not target.parent.is_dir():
        raise click.UsageError(f"--write: there is no folder {target.parent}: make it first")
    _require_free(target, overwrite)
    _require_no_parameters(files)
    study = None
    missed: tuple[Finding, ...] = ()
    *parts, data = parted(options, _fields())
    asked = {name: each for part in parts for name, each in part.items()}
    fleet = _fleet(
        files, "--type" if type_name is not None else "--joint-fit" if joint_fit else None
    )
    if fleet is not None or _holds_models(files):
        for name in data:
            raise click.UsageError(f"--{name} belongs to a log or records")
        settings = TuneSettings().changed(asked)
        tuning, refused = _of_models(files, log, settings, fleet, type_name, joint_fit), []
    else:
        from flightid.study import run_study

        own = TuneSettings().changed(asked).controller is not None
        if not own and log is None and _without_gains(files):
            own, asked["controller"] = True, USUAL
            note(
                "records hold no gains of an autopilot: these are gains of a PID of its own, "
                f"--controller {USUAL}"
            )
        cache: dict[str, Any] = {}
        path, folder, missed = taken_study(files, output, log, data, tune=not own, cache=cache)
        study = run_study(
            path, output=folder, log=log, tune=asked, level=level, cache=cache,
            gains_file="" if target is None else str(target),
        )  # fmt: skip
        tuning = study.tuning
        refused = [str(each).partition("] ")[2] for each in study.faults]
    if tuning is None:
        if study is not None and refused and not as_json:
            note(f"Wrote {study.output / 'report.html'}")
            show_answer(study)
            raise click.exceptions.Exit(Exit.RED)
        nothing = "there is no model of a rate that can be tuned"
        raise click.ClickException("; ".join(refused) or nothing)
    _tell(tuning, study, level, whole=study is None or whole or level is not None, as_json=as_json)
    if study is not None:
        note(f"Wrote {study.output / 'report.html'}")
    written: Sequence[Path] = ()
    if target is not None:
        accepted = bool(options.get("accept_red"))
        written = _write(tuning, target, overwrite, accept_red=accepted)
    if study is not None and not as_json:
        show_answer(study, written)
    leave_by_verdict((*missed, *tuning.findings))


def _require_no_parameters(files: Sequence[Path]) -> None:
    """Refuse files of gains, which are no records of a rig."""
    if given := next((each for each in files if each.suffix in PARAMETERS), None):
        raise click.UsageError(
            f"{given} holds parameters and no flight: name the log that flew them, "
            "flightid tune LOG"
        )


def _require_free(target: Path | None, overwrite: bool) -> None:
    """Refuse to replace files of gains before minutes go by, rather than after."""
    if target is None or overwrite:
        return
    first = target.with_name(f"{target.stem}-1{target.suffix}")
    taken = next((each for each in (target, first) if each.exists()), None)
    if taken is not None:
        raise OptionError(
            "a file of gains is there already",
            found=str(taken),
            needed="another name, or overwrite=True",
        )


def _write(tuning: Tuning, target: Path, overwrite: bool, *, accept_red: bool) -> Sequence[Path]:
    """Write what may be flown, the first to fly first, and name what stays as it flew."""
    from flightid.export.gains import write_gains

    written: Sequence[Path] = ()
    if tuning.sound or accept_red:
        written = write_gains(tuning, target, overwrite=overwrite, accept_red=accept_red)
    for path in written:
        note(f"Wrote {path}")
    for axis, why in ({} if accept_red else tuning.left_out).items():
        note(f"Not written, stays as flown: {axis}: {why}")
    return written


def _holds_models(files: tuple[Path, ...]) -> bool:
    """Whether models are meant: folders, JSON of fits, TOML with what every model file has."""
    from flightid.record.formats.sniff import is_bag

    if any((file.is_dir() and not is_bag(file)) or file.suffix == ".json" for file in files):
        return True
    if any(file.suffix != ".toml" for file in files):
        return False
    # A file that is no TOML is told as a study that cannot be read.
    from flightid.errors import FlightidError
    from flightid.reading import read_toml

    try:
        content = read_toml(files[0], "the file")
    except FlightidError:
        return len(files) > 1
    return len(files) > 1 or "estimated" in content or "kind" in content


def _without_gains(files: tuple[Path, ...]) -> bool:
    """Whether all there is are records, or a study of records that asks for no PID itself."""
    from flightid.study.settings import read_settings

    if not is_study(files):
        return not any(map(_is_flown, files))
    settings = read_settings(files[0])
    own = settings.tune is not None and settings.tune.controller is not None
    return settings.log is None and settings.flight is None and not own


def _is_flown(file: Path) -> bool:
    """Whether a file is a flight, whose log may hold gains."""
    from flightid.logs import is_log
    from flightid.record.formats.sniff import is_bag

    return is_bag(file) if file.is_dir() else is_log(file)


def _tell(
    tuning: Tuning, study: Study | None, level: float | None, *, whole: bool, as_json: bool
) -> None:
    """Tell of the gains all that goes before their files."""
    if study is not None:
        # Gains of which the answer fails are not to be loaded, and JSON ends as the screen does.
        answer_text(study)
    if as_json:
        emit_values(tuning.to_dict())
    elif whole:
        _show(tuning, level)


def _show(tuning: Tuning, level: float | None) -> None:
    """Every table of the gains."""
    click.echo(str(tuning.summary()))
    at = {} if level is None else {"level": level}
    if tuning.filters is not None:
        click.echo(f"\n{tuning.filters.table()}")
    for design in tuning.designs:
        if design.plain and design.exists:
            click.echo(f"\n{design.plain.form_table()}")
        click.echo(f"\n{design.worst_case_table(**at)}")
    if tuning.together:
        click.echo(f"\n{tuning.together_table()}")
    if any(each.closed for each in tuning.together):
        click.echo(f"\n{tuning.closed_table()}")


def _fleet(files: tuple[Path, ...], given: str | None) -> Path | None:
    """The fleet file or catalogue that is given; None where none is."""
    from flightid.fleet.recognition import is_fleet

    found = [file for file in files if is_fleet(file)]
    if found and len(files) > 1:
        raise click.UsageError(f"{found[0]} is a fleet: it is tuned alone")
    if not found and given is not None:
        raise click.UsageError(f"{given} belongs to a fleet: its file, or a catalogue's folder")
    return found[0] if found else None


def _of_models(
    files: tuple[Path, ...],
    log: Path | None,
    settings: TuneSettings,
    fleet: Path | None,
    type_name: str | None,
    joint_fit: bool,
) -> Tuning | None:
    from flightid import read_log
    from flightid.models.saved_files import models_of
    from flightid.study.tuning import tune_files, tune_loaded

    if log is None and settings.controller is None:
        named = " ".join(quote(str(file)) for file in files)
        raise click.UsageError(
            "models hold no gains: name the flight with --log, or a PID of its own with "
            f"--controller: flightid tune {named} --log LOG, flightid tune {named} "
            f"--controller {USUAL}"
        )
    flown = None if log is None else read_log(log)
    if fleet is None:
        found = [path for file in files for path in (models_of(file) if file.is_dir() else [file])]
        return tune_files(found, flown, settings)
    from flightid.fleet import type_models

    models = type_models(fleet, type_name=type_name, joint=joint_fit)
    for name, model in models.items():
        pooled = model.estimated.provenance
        note(f"{name}: {pooled['flights']} flights of {pooled['vehicles']} vehicles, pooled")
    return tune_loaded(models.values(), flown, settings)
