"""``flightid verify``: how a model predicts records that it has not seen."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from flightid.cli.output import HOLD_HELP, emit, emit_values, json_option, leave_by_verdict, note

if TYPE_CHECKING:
    from flightid.models.linear.hold_equivalent import Hold
    from flightid.validation import Comparison, ResidualTests, Verification


@click.command()
@click.argument("model")
@click.argument(
    "records",
    nargs=-1,
    required=True,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
)
@click.option("--axis", type=click.Choice(["roll", "pitch", "yaw"]), help="For library models.")
@click.option("--value", "values", multiple=True, metavar="NAME=NUMBER", help="Parameter value.")
@click.option(
    "--against",
    "rivals",
    multiple=True,
    metavar="MODEL",
    help="Rival model to verify side by side; may be repeated.",
)
@click.option("--output", "outputs", multiple=True, help="Output to compare; default: all.")
@click.option(
    "--initial-state",
    type=click.Choice(["trim", "zero", "measured", "estimate"]),
    help="Where runs start. Left out: as the kind of model starts.",
)
@click.option("--hold", type=click.Choice(["first", "zero"]), help=HOLD_HELP)
@click.option("--state-bias/--no-state-bias", default=None, help="Solve for state biases.")
@click.option("--output-bias/--no-output-bias", default=None, help="Solve for shifts of outputs.")
@click.option(
    "--residuals",
    "with_residuals",
    is_flag=True,
    help="Test measured minus predicted for independence of the inputs (loop taken as open).",
)
@click.option(
    "--html",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write a page with pictures to this file.",
)
@json_option
def command(
    model: str,
    records: tuple[Path, ...],
    axis: str | None,
    values: tuple[str, ...],
    rivals: tuple[str, ...],
    outputs: tuple[str, ...],
    initial_state: str | None,
    hold: Hold | None,
    state_bias: bool | None,
    output_bias: bool | None,
    with_residuals: bool,
    html: Path | None,
    as_json: bool,
) -> None:
    """Predict RECORDS with MODEL, a .toml file or the name of a library model.

    The records (CSV, Parquet, .mat, netCDF) hold the model's channels by name. The exit code is 1
    where a prediction of MODEL misses its guide, or a residual test that was asked for fails.
    """
    from flightid import Comparison, load_model, read_records, residual_tests, verify
    from flightid.models import load_structure

    chosen = load_model(model, axis=axis)
    if values:
        chosen = load_structure(model, axis=axis).with_values(dict(map(_number, values)))
    models = [chosen, *(load_model(rival, axis=axis) for rival in rivals)]
    shared = tuple(name for name in chosen.outputs if all(name in m.outputs for m in models))
    compared = outputs or shared
    flown = [
        record
        for path in records
        for record in read_records(path, inputs=chosen.inputs, outputs=compared)
    ]
    result: Verification | Comparison = verify(
        models if rivals else chosen,
        flown,
        state_bias=state_bias,
        output_bias=output_bias,
        initial_state=initial_state,
        outputs=compared,
        hold=hold,
    )
    on_trial = result.first if isinstance(result, Comparison) else result
    tests = residual_tests(on_trial) if with_residuals else None
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


def _number(text: str) -> tuple[str, float]:
    name, _, number = text.partition("=")
    try:
        return name, float(number)
    except ValueError:
        raise click.BadParameter(f"{text!r} is not NAME=NUMBER", param_hint="--value") from None


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
