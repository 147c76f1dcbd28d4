"""What a study file may say about a model: equations, or a structure without them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from flightid.study.fit_settings import FitSettings, VerifySettings, read_fit, read_verify
from flightid.study.published import PublishedFigures, read_published
from flightid.study.qualities_settings import read_cases
from flightid.study.reading import TableReader
from flightid.study.response_settings import ResponseSettings, read_response
from flightid.study.structure_settings import NARX, SUBSPACE, StructureSettings, read_structure

COHERENT, UNBROKEN = "coherent", "unbroken"
"""Responses by coherence: over all coherent frequencies, or over the widest band without a gap."""
METHODS = {NARX: "orthogonal_least_squares", SUBSPACE: "subspace"}
"""How a structure is fitted; the others by prediction errors."""


@dataclass(frozen=True)
class ModelSettings:
    """One model to identify.

    Attributes
    ----------
    name : str
        Title in the report.
    template : str or None
        Name of a library model, or path of a model file; None for a structure.
    axis : str or None
        Axis of a library model that is written for any.
    identify, verify : tuple of str
        Records for the fit, and records kept for verification.
    joint : tuple of str
        Records of a joint fit; those of `identify` then give the responses alone.
    band_rad_s : tuple of float or None
        Lowest and highest frequency of the fit, rad/s; None where records are fitted.
    responses : tuple of str
        Responses that are fitted, ``"output/input"``; ``("coherent",)``: those with coherence, over
        all frequencies that have it; ``("unbroken",)``: over the widest band without a gap. Empty:
        the model's own.
    outputs : tuple of str
        Outputs whose responses are fitted; empty: all.
    response : ResponseSettings
        How responses are estimated.
    fit : FitSettings
        How the model is fitted.
    check : VerifySettings
        How it is verified.
    parameters : mapping
        Overrides by parameter: value, minimum, maximum, free.
    rivals : mapping of str to str
        Models to verify side by side: library name, or path of a model file, by name.
    keep, drop : tuple of str
        Parameters that a reduction leaves in, or takes out first.
    condition : str or None
        Flight condition, where the study compares several.
    values_from : mapping of str to tuple of str
        Parameters that start at another model's estimates, by the name of that model.
    qualities : mapping of str to str
        Case of the standard of handling qualities, where it differs from the study's.
    reduce : bool
        Whether the reduction that the study asks for is meant for this model.
    reference : str or None
        Model whose parameters and modes stand beside the estimates: library name or model file.
    published : PublishedFigures or None
        What others found of its parameters, beside ours.
    structure : StructureSettings or None
        A structure without equations, whose order is looked for.
    """

    name: str
    template: str | None
    axis: str | None
    identify: tuple[str, ...]
    verify: tuple[str, ...]
    band_rad_s: tuple[float, float] | None
    response: ResponseSettings
    fit: FitSettings
    check: VerifySettings
    joint: tuple[str, ...] = ()
    responses: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    rivals: Mapping[str, str] = field(default_factory=dict)
    keep: tuple[str, ...] = ()
    drop: tuple[str, ...] = ()
    condition: str | None = None
    reference: str | None = None
    values_from: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    qualities: Mapping[str, str] = field(default_factory=dict)
    reduce: bool = True
    published: PublishedFigures | None = None
    structure: StructureSettings | None = None

    @property
    def segments(self) -> tuple[str, ...]:
        """Every record that the model uses."""
        beside = (*self.structure.select, *self.structure.coherence) if self.structure else ()
        return (*self.identify, *self.joint, *self.verify, *beside)

    @property
    def unfitted(self) -> tuple[str, ...]:
        """Records that choose a structure or verify, and are not fitted."""
        return (*(self.structure.select if self.structure else ()), *self.verify)

    @property
    def flown(self) -> tuple[str, ...]:
        """Records of the frequency responses."""
        return self.identify if self.structure is None else self.structure.coherence

    @property
    def by_coherence(self) -> bool:
        """Whether coherence says which responses are fitted."""
        return self.responses in ((COHERENT,), (UNBROKEN,))


def read_model(
    reader: TableReader,
    folder: Path,
    *,
    response: ResponseSettings,
    fit: FitSettings,
    check: VerifySettings,
    reduced: bool,
) -> ModelSettings:
    """Check one table ``[[model]]``; what it says of stages goes over the study's.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    response = read_response(reader.table("response"), response)
    check = read_verify(reader.table("check"), check)
    if "structure" in reader:
        return _without_equations(reader, folder, response=response, check=check)
    template = reader.text("template")
    fit = read_fit(reader.table("fit"), fit)
    joint = reader.names("joint", ())
    if joint and fit.method != "joint":
        raise reader.error(
            "joint", "names records of a joint fit", found=fit.method, needed='method = "joint"'
        )
    if fit.method == "joint" and not joint:
        raise reader.error(
            "joint", "is missing", found="none", needed="records beside those of the responses"
        )
    made = ModelSettings(
        reader.text("name"),
        _placed(folder, template),
        reader.maybe(reader.text, "axis"),
        reader.names("identify"),
        reader.names("verify", ()),
        _band(reader, response if fit.on_responses else None),
        response,
        fit,
        check,
        joint,
        reader.names("responses", ()),
        reader.names("outputs", ()),
        read_overrides(reader),
        _rivals(reader, folder),
        *((reader.names("keep", ()), reader.names("drop", ())) if reduced else ((), ())),
        condition=reader.maybe(reader.text, "condition"),
        **_beside(reader, folder),
        values_from=_values_from(reader),
        qualities=read_cases(reader.table("qualities")),
        reduce=reader.flag("reduce", True) if reduced else False,
    )
    reader.finish()
    return made


def _without_equations(
    reader: TableReader, folder: Path, *, response: ResponseSettings, check: VerifySettings
) -> ModelSettings:
    identify = reader.names("identify")
    # Only a response needs a band: without one no coherence is shown, and all inputs are kept.
    responds = "coherence" in reader or "band_rad_s" in reader or response.band_rad_s is not None
    structure = read_structure(reader, identify)
    made = ModelSettings(
        reader.text("name"),
        None,
        None,
        identify,
        reader.names("verify", ()),
        _band(reader, response) if responds else None,
        response,
        FitSettings(METHODS.get(structure.kind, "prediction_error")),
        replace(check, without_equations=True),
        rivals=_rivals(reader, folder),
        condition=reader.maybe(reader.text, "condition"),
        **_beside(reader, folder),
        structure=structure,
    )
    reader.finish()
    return made


def _band(reader: TableReader, response: ResponseSettings | None) -> tuple[float, float] | None:
    """Band of the model, else that of its responses, which need one."""
    if response is None or response.band_rad_s is not None:
        band = reader.maybe(reader.interval, "band_rad_s")
        band = response.band_rad_s if band is None and response is not None else band
    else:
        band = reader.interval("band_rad_s")
    if band is not None and not 0 < band[0] < band[1]:
        raise reader.error("band_rad_s", "does not fit", found=band, needed="positive frequencies")
    return band


def _beside(reader: TableReader, folder: Path) -> dict[str, Any]:
    """What stands beside the estimates: a model, and printed figures."""
    reference = reader.maybe(reader.text, "reference")
    published = reader.maybe(reader.text, "published")
    return {
        "reference": None if reference is None else _placed(folder, reference),
        "published": None if published is None else read_published(folder / published),
    }


def _rivals(reader: TableReader, folder: Path) -> dict[str, str]:
    return {rival: _placed(folder, rival) for rival in reader.names("rivals", ())}


def _values_from(reader: TableReader) -> dict[str, tuple[str, ...]]:
    inner = reader.table("values_from")
    return {name: inner.names(name) for name in reader.values("values_from")}


def _placed(folder: Path, source: str) -> str:
    """A library name as it is, a model file beside the study."""
    return str(folder / source) if source.endswith(".toml") else source


def read_overrides(reader: TableReader) -> dict[str, dict[str, Any]]:
    """Values, bounds and freedom of parameters by name."""
    overrides: dict[str, dict[str, Any]] = {}
    parameters = reader.table("parameters")
    for name in reader.values("parameters"):
        entry = parameters.table(name)
        given: dict[str, Any] = {
            key: entry.maybe(entry.number, key) for key in ("value", "minimum", "maximum")
        }
        given["free"] = entry.maybe(entry.flag, "free")
        entry.finish()
        overrides[name] = {key: value for key, value in given.items() if value is not None}
    return overrides
