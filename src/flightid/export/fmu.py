"""Export to FMI 3.0: the C of a model with the standard's interface around it, zipped.

Libraries were weighed first. pythonfmu3 packs a Python class and needs Python inside the importer;
FMPy checks and runs FMUs but makes none. Our code is C already, so its interface is written here.
"""

from __future__ import annotations

import hashlib
import io
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flightid.conventions import Light
from flightid.errors import ExportError, OptionError
from flightid.export.as_equations import equations_of
from flightid.export.c_compiler import (
    c_compiler,
    compile_library,
    library_suffix,
    platform_tuple,
)
from flightid.export.c_source import (
    CSource,
    c_environment,
    equation_source,
    linear_source,
)
from flightid.export.exported import ExportFiles
from flightid.export.fmu_description import FmuDescription
from flightid.export.names import comment, identifier
from flightid.export.options import FmuOptions, Interface
from flightid.files import write_atomically
from flightid.findings import Finding
from flightid.models import LinearSystem, StateSpaceModel
from flightid.models.model import linear_system
from flightid.version import VERSION

BOTH: tuple[Interface, ...] = ("model-exchange", "co-simulation")
RADIUS = 0.05
"""Largest product of internal step and eigenvalue: relative errors near 0.05^4/120 = 5e-8."""
_TYPES = "Float32 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String Binary Clock"
_ABSENT = (
    *(f"{verb}{kind}" for verb in ("Get", "Set") for kind in _TYPES.split()),
    *("GetNumberOfVariableDependencies", "GetVariableDependencies"),
    *("SerializedFMUStateSize", "SerializeFMUState", "DeserializeFMUState"),
    *("GetDirectionalDerivative", "GetAdjointDerivative", "GetOutputDerivatives"),
    *(f"{verb}{what}{kind}" for verb in ("Get", "Set") for what in ("Interval", "Shift")
      for kind in ("Decimal", "Fraction")),
    "ActivateModelPartition",
)  # fmt: skip


def export_fmu(model: object, path: Path, name: str, options: FmuOptions) -> ExportFiles:
    """Write an FMU of FMI 3.0.

    Parameters
    ----------
    model : StateSpaceModel, or what `linear_system` takes
        A continuous one keeps its parameters, or the entries of its matrices, tunable.
    path : Path
        File ending in ``.fmu``.
    name : str
        Of the model.
    options : FmuOptions
        Without substeps the product of step and eigenvalue is at most 0.05.

    Raises
    ------
    ExportError
        There is no C compiler; model exchange was asked of a model with delays or samples.
    OptionError
        A missing sample time.

    Reference
    ---------
    Modelica Association, *Functional Mock-up Interface Specification*, version 3.0.2.
    """
    if path.suffix.lower() != ".fmu":
        raise OptionError("an FMU is a file in .fmu", found=path.name)
    prepared = _prepared(model, options.pade_order)
    chosen, findings = _interfaces(prepared, options.interfaces)
    step = options.sample_time_s
    prefix = identifier(name)
    if isinstance(prepared, StateSpaceModel):
        code = equation_source(
            prepared, name, prefix, step, "zero", options.substeps, radius=RADIUS
        )
    else:
        code = linear_source(prepared, name, prefix, step, "zero")
    made = {f"sources/{key}": text for key, text in _sources(code, name, chosen).items()}
    token = "{" + hashlib.sha256("".join(made.values()).encode()).hexdigest()[:32] + "}"
    made = {key: text.replace(_TOKEN, token) for key, text in made.items()}
    description = FmuDescription(code, name, token, chosen)
    content: dict[str, bytes] = {"modelDescription.xml": description.text().encode()}
    content |= {key: text.encode() for key, text in made.items()}
    place = f"binaries/{platform_tuple()}/{code.prefix}{library_suffix()}"
    if options.compile:
        content[place] = _binary(made, code.prefix)
    else:
        findings.append(_sources_alone())
    write_atomically(path, _zipped(content))
    facts = {
        "interfaces": " and ".join(chosen),
        "internal step": f"{code.sample_time_s:g} s",
        "method": code.method,
        "binary": place if options.compile else "none",
        "tunable": f"{len(code.parameters)} parameters",
    }
    return ExportFiles("fmu", (path,), facts, tuple(findings))


_TOKEN = "@TOKEN@"


def _prepared(model: object, pade_order: int | None) -> StateSpaceModel | LinearSystem:
    """Equations with parameters, or a discrete system."""
    if isinstance(model, StateSpaceModel):
        if pade_order is None:
            return model
        if not model.is_linear:
            raise ExportError(
                "delays of a nonlinear model are not approximated here",
                found=f"pade_order={pade_order}",
                action="put a block of kind 'pade_delay' into the model",
            )
    system = linear_system(model)
    if system.is_discrete:
        return system
    if pade_order is not None:
        system = system.with_pade(pade_order)
    return equations_of(system)


def _interfaces(
    model: StateSpaceModel | LinearSystem, wanted: Sequence[Interface] | None
) -> tuple[tuple[Interface, ...], list[Finding]]:
    reason = ""
    if isinstance(model, LinearSystem):
        reason = "the model is a recursion over samples"
    elif np.any(model.matrices().delays_s):
        reason = "its inputs are delayed"
    if not reason:
        return (BOTH if wanted is None else tuple(wanted)), []
    if wanted is not None and "model-exchange" in wanted:
        raise ExportError(
            "model exchange knows states and their derivatives alone",
            found=reason,
            needed="interfaces=('co-simulation',), or pade_order for delays",
        )
    finding = Finding(
        "no-model-exchange",
        Light.AMBER,
        f"model exchange is left out: {reason}",
        "for delays give pade_order; co-simulation has them exactly",
    )
    return ("co-simulation",), [finding]


def _sources_alone() -> Finding:
    return Finding(
        "sources-alone",
        Light.AMBER,
        "the FMU holds no binary: its importer must compile the sources",
        "export where there is a C compiler, with compile=True",
    )


def _sources(code: CSource, name: str, interfaces: tuple[Interface, ...]) -> dict[str, str]:
    words = {
        "title": comment(name),
        "version": VERSION,
        "file_stem": code.stem,
        "prefix": code.prefix,
        "equations": code.is_equations,
        "exchanged": "model-exchange" in interfaces,
        "stepped": "co-simulation" in interfaces,
        "token": _TOKEN,
        "absent": _ABSENT,
    }
    glue = c_environment().get_template("fmi3.c.j2").render(words)
    build = c_environment().get_template("buildDescription.xml.j2").render(words)
    return {
        f"{code.stem}.h": code.header,
        f"{code.stem}.c": code.source,
        f"{code.stem}_fmi3.c": glue,
        "buildDescription.xml": build,
    }


def _binary(sources: dict[str, str], prefix: str) -> bytes:
    if c_compiler() is None:
        raise ExportError(
            "there is no C compiler for the FMU's binary",
            needed="cc, gcc or clang",
            action="install one, or export the sources alone with compile=False",
        )
    with tempfile.TemporaryDirectory() as folder:
        for name, text in sources.items():
            (Path(folder) / Path(name).name).write_text(text, encoding="utf-8")
        files = sorted(Path(folder).glob("*.c"))
        library = compile_library(files, Path(folder) / f"{prefix}{library_suffix()}")
        return library.read_bytes()


def _zipped(content: dict[str, bytes]) -> bytes:
    """An archive that is the same for the same content."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            item = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            item.compress_type = zipfile.ZIP_DEFLATED
            item.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(item, data)
    return buffer.getvalue()
