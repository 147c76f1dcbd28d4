"""``flightid verify``: how a model predicts records that it has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import all_option, emit, emit_values, json_option, leave_by_verdict, note
from flightid.cli.pages import html_option
from flightid.cli.records import FILES, FilesArgument, read_files, reading
from flightid.cli.sources import load_source, model_argument, model_options

if TYPE_CHECKING:
    from flightid.models import Model
    from flightid.options import Options
    from flightid.validation import Comparison, ResidualTests, Verification


def _fields() -> dict[str, type[Options]]:
    from flightid.record.options import ComparedOptions
    from flightid.validation.residuals.options import ResidualTestOptions
    from flightid.validation.verification.options import VerifyOptions

    return {
        "channels": ComparedOptions,
        "the prediction": VerifyOptions,
        "residual tests": ResidualTestOptions,
        **reading(),
    }


@click.command(cls=OptionsCommand, fields_of=_fields)
@model_argument
@click.argument("records", nargs=-1, required=True, type=FILES, cls=FilesArgument)
@model_options
@click.option(
    "--against",
    "rivals",
    multiple=True,
    metavar="MODEL",
    help="Rival model to verify side by side; may be repeated.",
)
@click.option(
    "--residual-tests",
    "with_residuals",
    is_flag=True,
    help="Test measured minus predicted for independence of the inputs, or of what was injected.",
)
@html_option
@all_option
@json_option
def command(
    model: str,
    records: tuple[Path, ...],
    axis: str | None,
    values: tuple[str, ...],
    rivals: tuple[str, ...],
    with_residuals: bool,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Predict RECORDS with MODEL.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model; RECORDS (CSV, Parquet, .mat, netCDF, logs) hold its channels by name. The exit
    code is 1 where a prediction of MODEL misses its guide, or a residual test that was asked for
    fails.
    """
    from flightid import Comparison, residual_tests, verify

    chosen = load_source(model, axis, values)
    models = [chosen, *(load_source(rival, axis) for rival in rivals)]
    channels, given, of_tests, *of_files = parted(options, _fields())
    # What was injected tells a run's gusts from its misses, tests or none.
    if of_tests.keys() - {"excitations"} and not with_residuals:
        raise click.UsageError("--loop and --maximum-lag are of --residual-tests")
    shared = [name for name in chosen.outputs if all(name in m.outputs for m in models)]
    compared = channels.get("outputs") or shared
    flown = read_files(
        records, *of_files, inputs=chosen.inputs, outputs=compared, units=chosen.units,
        excitations=of_tests.get("excitations"), take="unseen",
    )  # fmt: skip
    result: Verification | Comparison
    if rivals:
        named = _file_names([model, *rivals], models)
        result = verify([*models], flown, outputs=compared, names=named, **given)
    else:
        result = verify(chosen, flown, outputs=compared, **given)
    on_trial = result.first if isinstance(result, Comparison) else result
    tests = residual_tests(on_trial, **of_tests) if with_residuals else None
    if as_json:
        extra = {} if tests is None else {"residual_tests": tests.to_dict()}
        emit_values(result.to_dict() | extra)
    else:
        emit(result, as_json=False)
        if tests is not None:
            emit(tests, as_json=False)
    if html is not None:
        note(f"Wrote {_write_page(result, tests, str(chosen), html)}")
    leave_by_verdict((*result.findings, *(() if tests is None else tests.findings)))


def _file_names(given: Sequence[str], models: Sequence[Model]) -> list[str] | None:
    """Names by which models of one name are told apart: of their files; None where they are."""
    own = [str(getattr(model, "name", "")) for model in models]
    if len({*own}) == len(own):
        return None
    stems = [Path(name).stem for name in given]
    return next((each for each in (stems, [*given]) if len({*each}) == len(each)), None)


def _write_page(
    result: Verification | Comparison, tests: ResidualTests | None, model: str, path: Path
) -> Path:
    from flightid.files import write_atomically
    from flightid.plot.residuals import correlations
    from flightid.report.blocks import result_blocks
    from flightid.report.content import Document, Section
    from flightid.report.figures import figure_block
    from flightid.report.html import to_html
    from flightid.report.verification import verification_sections

    sections = [*verification_sections(result)]
    if tests is not None:
        drawn = tuple(
            figure_block(correlations(tests, output, name), f"Residual of {output} against {name}.")
            for output in tests.outputs
            for name in tests.inputs
        )
        sections.append(Section("Residual tests", (*result_blocks(tests), *drawn)))
    return write_atomically(path, to_html(Document("Verification", model, tuple(sections))))
