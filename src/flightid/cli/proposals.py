"""The study of a log or of records that a command takes in place of a study file."""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping, Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.output import Exit, emit_values, note

if TYPE_CHECKING:
    from flightid.findings import Finding
    from flightid.options import Options
    from flightid.study import Study
    from flightid.study.proposal import Proposal


def of_data() -> dict[str, type[Options]]:
    """Options of a study that is written for data."""
    from flightid.study.proposal.options import ProposalOptions

    return {"a log or records": ProposalOptions}


def study_path(files: Sequence[Path], output: Path | None = None) -> Path:
    """Where the study of data is written: beside its results, or else beside the data."""
    folder = files[0].parent if output is None else output.parent
    return folder / f"{files[0].stem}-study.toml"


def propose(files: Sequence[Path], target: Path, **asked: Any) -> Proposal:  # noqa: ANN401
    """The study of data, for a place; see `flightid.study.proposal.propose_study`."""
    from flightid.progress import progress
    from flightid.study.proposal import propose_study

    with progress(None, f"looking at {files[0].name}"):
        return propose_study(files, folder=target.parent, **asked)


def note_of(made: Proposal) -> None:
    """Say what data were taken for, and what was left out of the study."""
    from flightid.conventions import Light
    from flightid.findings import said_once

    for text in made.said:
        note(text)
    for finding in said_once(made.findings):
        light = "" if finding.light is Light.GREEN else f"{finding.light.words}: "
        note(f"{light}{finding.message}")


def end_without_model(made: Proposal) -> None:
    """Say what is there and what to do, and end the command, where data carry no model."""
    if not made.models:
        click.echo(made.refusal())
        click.get_current_context().exit(Exit.RED)


def is_study(files: Sequence[Path]) -> bool:
    """Whether a study is meant: one file in TOML."""
    return len(files) == 1 and files[0].suffix == ".toml"


def taken_study(
    files: Sequence[Path],
    output: Path | None,
    log: Path | None,
    asked: Mapping[str, Any],
    *,
    tune: bool = False,
    cache: MutableMapping[str, Any] | None = None,
) -> tuple[Path, Path | None, tuple[Finding, ...]]:
    """The study that was named, or the one that data ask for, written beside its results.

    What is read and found of a log stands in `cache` for the run of the study. Where the data
    carry no model, what is there is said, and the command ends.

    Returns
    -------
    tuple of Path, Path or None, and tuple of Finding
        The study, the folder of its results, and what it has no model of.

    Raises
    ------
    click.UsageError
        An option of studies for data, or the other way round.
    """
    if is_study(files):
        from flightid.cli.option_fields import flags_of
        from flightid.study.proposal.options import ProposalOptions

        usual = ProposalOptions()
        for name, value in asked.items():
            if value and value != getattr(usual, name, value):
                raise click.UsageError(
                    f"{flags_of(name)[-1]} belongs to a log or records; a study says its own"
                )
        return files[0], output, ()
    if log is not None:
        raise click.UsageError("--log belongs to a study, and there is none")
    target = study_path(files, output)
    made = propose(files, target, **asked, tune=tune, cache=cache)
    end_without_model(made)
    made.write(target)
    note(f"Wrote {target}")
    note_of(made)
    from flightid.study.output import output_folder

    return target, output or output_folder(target), made.findings


def show_study(result: Study, *, whole: bool, as_json: bool) -> None:
    """Print a study: one screen with the answer last, the whole report, or JSON."""
    from flightid.report.text import to_text

    if as_json:
        emit_values(result.to_dict())
    elif whole:
        click.echo(to_text(result.document), nl=False)
    # Before the answer, which is to stand where eyes are.
    note(f"Wrote {result.output / 'report.html'}")
    if not (as_json or whole):
        show_answer(result)


def show_answer(result: Study, written: Sequence[Path] = ()) -> None:
    """Print one screen of a study; see `answer_text`."""
    click.echo(answer_text(result, written), nl=False)


def answer_text(result: Study, written: Sequence[Path] = ()) -> str:
    """One screen of a study, its verdict and the next step last.

    `written` are files of its gains, the first to fly first, which need no command any more.
    """
    from flightid.report.text import to_text
    from flightid.study.answer import short_document
    from flightid.uncertainty.quantiles import showing

    with showing(result.settings.level):
        names, place = [str(path) for path in written], quote(str(result.output))
        return to_text(short_document(result, result.document, names, place))
