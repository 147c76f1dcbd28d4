"""Export to C: two files, written together."""

from __future__ import annotations

from pathlib import Path

from flightid.errors import ExportError, OptionError
from flightid.export.c_source import CSource, equation_source, file_stem, linear_source
from flightid.export.exported import ExportFiles
from flightid.export.narx_source import narx_source
from flightid.export.options import SourceOptions
from flightid.files import write_atomically
from flightid.models import NarxModel, StateSpaceModel
from flightid.models.model import linear_system


def model_source(model: object, name: str, stem: str, options: SourceOptions) -> CSource:
    """C text of a model: equations where it is nonlinear or to be tuned, else exact samples.

    Parameters
    ----------
    model : StateSpaceModel, LinearSystem or what `linear_system` takes
    name, stem : str
        Of the model, and of the files.
    options : SourceOptions

    Raises
    ------
    OptionError
        A sample time that is missing; substeps of an exact discretisation.
    ExportError
        A model without equations cannot be tuned.
    """
    step, hold = options.sample_time_s, options.hold
    equations = isinstance(model, StateSpaceModel) and (options.tunable or not model.is_linear)
    if isinstance(model, StateSpaceModel) and equations:
        return equation_source(model, name, stem, step, hold, options.substeps)
    if options.tunable:
        raise ExportError(
            "a model without equations has no parameters that code could change",
            found=type(model).__name__,
            needed="a StateSpaceModel",
        )
    if options.substeps is not None:
        raise OptionError(
            "a linear or sampled model has no substeps: its steps are exact",
            found=options.substeps,
        )
    if isinstance(model, NarxModel):
        return narx_source(model, name, stem, step, hold)
    return linear_source(linear_system(model), name, stem, step, hold)


def export_c(model: object, path: Path, name: str, options: SourceOptions) -> ExportFiles:
    """Write header and source; `model_source` says how."""
    made = model_source(model, name, file_stem(path), options)
    # The source names the header: it comes first, so that no source is seen without its header.
    header = write_atomically(path.with_suffix(".h"), made.header)
    source = write_atomically(path.with_suffix(".c"), made.source)
    facts = {
        "prefix": made.prefix,
        "step": f"{made.sample_time_s:g} s",
        "method": made.method,
        "size": f"{len(made.states)} states, {len(made.inputs)} inputs, "
        f"{len(made.outputs)} outputs, {len(made.parameters)} parameters",
        "build": f"cc -std=c99 -O2 -c {source.name}",
    }
    return ExportFiles("c", (source, header), facts)
