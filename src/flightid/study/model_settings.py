"""What a study file may say about a model with equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flightid.study.fit_settings import FitSettings, VerifySettings, read_fit, read_verify
from flightid.study.reading import TableReader
from flightid.study.response_settings import ResponseSettings, read_response

COHERENT, UNBROKEN = "coherent", "unbroken"
"""Responses by coherence: over all coherent frequencies, or over the widest band without a gap."""


@dataclass(frozen=True)
class ModelSettings:
    """One model to identify.

    Attributes
    ----------
    name : str
        Title in the report.
    template : str
        Name of a library model, or path of a model file.
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
    reduce : bool
        Whether the reduction that the study asks for is meant for this model.
    reference : str or None
        Model whose parameters and modes stand beside the estimates: library name or model file.
    """

    name: str
    template: str
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
    reduce: bool = True

    @property
    def segments(self) -> tuple[str, ...]:
        """Every record that the model uses."""
        return (*self.identify, *self.joint, *self.verify)

    @property
    def template_path(self) -> Path | None:
        """Path of the model file; None for a library model."""
        return Path(self.template) if self.template.endswith(".toml") else None

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
    """Check one table ``[[model]]`` with equations; what it says of stages goes over the study's.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    template = reader.text("template")
    response = read_response(reader.table("response"), response)
    fit = read_fit(reader.table("fit"), fit)
    check = read_verify(reader.table("check"), check)
    joint = reader.names("joint", ())
    if joint and fit.method != "joint":
        raise reader.error(
            "joint", "names records of a joint fit", found=fit.method, needed='method = "joint"'
        )
    if fit.method == "joint" and not joint:
        raise reader.error(
            "joint", "is missing", found="none", needed="records beside those of the responses"
        )
    band = (
        reader.interval("band_rad_s")
        if fit.on_responses
        else reader.maybe(reader.interval, "band_rad_s")
    )
    if band is not None and band[0] <= 0:
        raise reader.error("band_rad_s", "does not fit", found=band, needed="positive frequencies")
    reference = reader.maybe(reader.text, "reference")
    made = ModelSettings(
        reader.text("name"),
        _placed(folder, template),
        reader.maybe(reader.text, "axis"),
        reader.names("identify"),
        reader.names("verify", ()),
        band,
        response,
        fit,
        check,
        joint,
        reader.names("responses", ()),
        reader.names("outputs", ()),
        read_overrides(reader),
        {rival: _placed(folder, rival) for rival in reader.names("rivals", ())},
        *((reader.names("keep", ()), reader.names("drop", ())) if reduced else ((), ())),
        condition=reader.maybe(reader.text, "condition"),
        reference=None if reference is None else _placed(folder, reference),
        values_from=_values_from(reader),
        reduce=reader.flag("reduce", True) if reduced else False,
    )
    reader.finish()
    return made


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
