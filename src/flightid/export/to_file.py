"""Models to files of other tools: one verb, the format by the file's suffix."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from flightid.control.autopilots.pid_loop import PidLoop
from flightid.control.tuning.pid_design import PidDesign, require_gains
from flightid.conventions import Light
from flightid.errors import ExportError, OptionError
from flightid.export.c import export_c
from flightid.export.exported import ExportFiles
from flightid.export.fmu import export_fmu
from flightid.export.jsbsim import export_jsbsim
from flightid.export.options import FORMATS
from flightid.export.pid_source import export_pid
from flightid.files import as_path
from flightid.findings import Finding
from flightid.identification import Fit
from flightid.models import (
    StateSpaceModel,
    TransferFunctionModel,
    write_model,
    write_system,
)
from flightid.models.linear.system_files import MATLAB_RECIPE
from flightid.models.model import linear_system, model_of
from flightid.options import Options, checked

SUFFIXES = {
    ".toml": "toml",
    ".mat": "mat",
    ".json": "json",
    ".npz": "npz",
    ".c": "c",
    ".h": "c",
    ".fmu": "fmu",
    ".xml": "jsbsim",
}

_WRITERS: Mapping[str, Callable[..., ExportFiles]] = {
    "c": export_c,
    "fmu": export_fmu,
    "jsbsim": export_jsbsim,
}


def export(
    source: object,
    path: str | Path,
    format: str | None = None,
    *,
    name: str | None = None,
    **options: object,
) -> ExportFiles:
    """Write a model to a file of another tool, whole or not at all.

    Parameters
    ----------
    source : a fit, a model, a LinearSystem or a PidDesign
        A fit gives its model; what a format can hold of its uncertainty goes along. The design of
        a PID of its own is written as C or TOML.
    path : str or Path
        File to write; its folder must exist.
    format : str, optional
        ``"toml"`` (flightid's own), ``"mat"``, ``"json"``, ``"npz"`` (matrices), ``"c"``
        (portable C99, two files), ``"fmu"`` (FMI 3.0) or ``"jsbsim"`` (aerodynamics in .xml).
        Left out: by the suffix.
    name : str, optional
        Of the model in the file; left out: the file's name.
    **options
        Of the format: the fields of its dataclass in `flightid.export.options.FORMATS`.

    Returns
    -------
    ExportFiles
        The files, how they are used, and what the format could not carry.

    Raises
    ------
    OptionError
        An unknown format or option.
    ExportError
        The model has no counterpart in the format.
    ModelError
        The source is no model, or contradicts the options.
    OSError
        The file cannot be written.

    Reference
    ---------
    ISO/IEC 9899:1999 (C99); Modelica Association, *Functional Mock-up Interface Specification*,
    version 3.0.2.

    Example
    -------
    >>> import tempfile
    >>> import flightid as fid
    >>> roll = fid.load_model("rate_first_order").with_values({"Lp": -5.0, "Ltphi": 150.0})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export(roll, f"{folder}/roll.c", sample_time_s=1 / 400)
    ExportFiles(c: roll.c, roll.h)
    """
    place = as_path(path)
    chosen = format_of(place, format)
    if isinstance(source, PidDesign):
        checked(Options, options, "a controller")
        return _controller(source, place, name or place.stem, chosen)
    made = checked(FORMATS[chosen], options, f"format {chosen}")
    model = model_of(source)
    if chosen in _WRITERS:
        files = _WRITERS[chosen](model, place, name or place.stem, made)
        return replace(files, options=made.to_dict())
    return _toml(model, place) if chosen == "toml" else _matrices(source, model, place, chosen)


def format_of(path: Path, format: str | None = None) -> str:
    """Format of a file: the one that is named, else by its suffix.

    Raises
    ------
    OptionError
        Neither says one.
    """
    chosen = format or SUFFIXES.get(path.suffix.lower(), "")
    if chosen not in FORMATS:
        known = ", ".join(f"{kind} ({suffix})" for suffix, kind in SUFFIXES.items())
        raise OptionError("format of an export is not known", found=format or path.name,
                          needed=f"one of {known}")  # fmt: skip
    return chosen


def _controller(design: PidDesign, path: Path, name: str, format: str) -> ExportFiles:
    loop = plain_loop(design, format)
    require_gains([design])
    if format == "c":
        return export_pid(loop, path, name)
    return ExportFiles("toml", design.write(path, overwrite=True))


def plain_loop(design: PidDesign, format: str = "c") -> PidLoop:
    """The PID of its own that a design tuned.

    Raises
    ------
    ExportError
        It tuned an autopilot, or the format holds no controller.
    """
    if design.plain is None or format not in ("c", "toml"):
        raise ExportError(
            "the gains of a controller have no such file",
            found=f"{design.flown.autopilot} as {format}",
            needed="a PID of its own, as C or TOML",
            action="write the gains of an autopilot as its parameter file",
        )
    return design.plain


def _toml(model: object, path: Path) -> ExportFiles:
    if path.suffix != ".toml":
        raise OptionError("a TOML file ends in .toml", found=path.name)
    write_model(model, path)
    return ExportFiles("toml", (path,), {"read": f"flightid.load_model({path.name!r})"})


def _matrices(source: object, model: object, path: Path, format: str) -> ExportFiles:
    if path.suffix.lower() != f".{format}":
        raise OptionError("the suffix is not that of the format", found=path.name, needed=format)
    system = linear_system(model)
    write_system(system, path, _parameters(source))
    facts = {"read": f"flightid.read_system({path.name!r})"}
    if format == "mat":
        lines = [line.format(name=path.name.replace("'", "''")) for line in MATLAB_RECIPE]
        facts["in MATLAB"] = "\n".join(lines)
    findings = []
    if isinstance(model, StateSpaceModel) and not model.is_linear:
        findings.append(
            Finding(
                "linearised",
                Light.AMBER,
                "matrices hold the linearisation at the trim; what is nonlinear is left out",
                "export the equations as toml, c or fmu",
            )
        )
    return ExportFiles(format, (path,), facts, tuple(findings))


def _parameters(source: object) -> dict[str, object]:
    """Names, values, units, standard errors and covariance, as far as they are known."""
    found: dict[str, object]
    if isinstance(source, Fit):
        items = list(source.parameters.values())
        found = {
            "names": [item.name for item in items],
            "values": [item.value for item in items],
            "units": [item.unit for item in items],
            "stderr": [item.stderr for item in items],
            "free": list(source.names),
        }
        if source.covariance is not None:
            found["covariance"] = np.asarray(source.covariance)
        return found
    model = model_of(source)
    found = {}
    if isinstance(model, TransferFunctionModel | StateSpaceModel):
        free = model.parameters.independent
        found = {
            "names": [item.name for item in free],
            "values": [float(value) for value in model.parameters.independent_values()],
            "units": [item.unit for item in free],
        }
    known = getattr(model, "estimated", None)
    if known is not None and known.covariance is not None:
        found |= {"free": list(known.names), "covariance": known.covariance}
    return found
