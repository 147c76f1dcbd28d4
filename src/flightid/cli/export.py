"""``flightid export``: a model for another tool."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.option_fields import flags_of
from flightid.cli.output import emit, json_option
from flightid.cli.pairs import numbers, pairs
from flightid.cli.sources import load_source, model_options


@click.command()
@click.argument("model")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--format", help="Left out: by the suffix of FILE.")
@click.option("--name", help="Of the model in FILE; left out: the file's name.")
@model_options
@click.option(
    *flags_of("sample_rate_hz"),
    "rate",
    type=click.FloatRange(0.0, min_open=True),
    help="Steps a second of C, internal steps of an FMU, Hz.",
)
@click.option("--hold", type=click.Choice(["zero", "first"]), help="Inputs between samples, in C.")
@click.option("--substeps", type=click.IntRange(1), help="Runge-Kutta steps in a sample.")
@click.option("--tunable", is_flag=True, help="C with parameters to change.")
@click.option(
    "--interface",
    "interfaces",
    multiple=True,
    type=click.Choice(["model-exchange", "co-simulation"]),
    help="Of an FMU; may be repeated. Left out: both where the model allows it.",
)
@click.option("--pade-order", type=click.IntRange(1), help="Approximate delays in an FMU.")
@click.option("--sources-only", is_flag=True, help="An FMU without a binary.")
@click.option("--mass", type=float, help="For JSBSim, kg.")
@click.option("--inertia", multiple=True, help="ixx=KG_M2 and so on, for JSBSim.")
@click.option("--trim", multiple=True, help="u=M_PER_S, theta=RAD and so on, for JSBSim.")
@click.option("--property", "properties", multiple=True, help="INPUT=PROPERTY of JSBSim.")
@json_option
def command(
    model: str,
    file: Path,
    format: str | None,
    name: str | None,
    axis: str | None,
    values: tuple[str, ...],
    rate: float | None,
    hold: str | None,
    substeps: int | None,
    tunable: bool,
    interfaces: tuple[str, ...],
    pade_order: int | None,
    sources_only: bool,
    mass: float | None,
    inertia: tuple[str, ...],
    trim: tuple[str, ...],
    properties: tuple[str, ...],
    as_json: bool,
) -> None:
    """Write MODEL to FILE.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model. The suffix of FILE chooses: .toml (flightid), .mat (MATLAB), .json, .npz
    (matrices), .c (portable C99), .fmu (FMI 3.0), .xml (JSBSim aerodynamics).
    """
    from flightid import export

    chosen = load_source(model, axis, values)
    given: dict[str, object] = {
        "sample_time_s": None if rate is None else 1.0 / rate,
        "hold": hold,
        "substeps": substeps,
        "tunable": tunable or None,
        "interfaces": interfaces or None,
        "pade_order": pade_order,
        "compile": False if sources_only else None,
        "mass_kg": mass,
        "inertia_kg_m2": numbers("--inertia", inertia) or None,
        "trim": numbers("--trim", trim) or None,
        "properties": pairs("--property", properties) or None,
    }
    options = {key: value for key, value in given.items() if value is not None}
    emit(export(chosen, file, format, name=name, **options), as_json=as_json)
