"""What a study file may say about a model: equations, or a structure without them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path

from flightid.frozen import dataclass
from flightid.option_forms import NOTHING, ONE, SPAN, part_of
from flightid.options import Options, option
from flightid.study.fit_settings import FitSettings, VerifySettings, read_fit
from flightid.study.published import PublishedFigures, read_published
from flightid.study.qualities_settings import QualityCase
from flightid.study.reading import TableReader, read_own, read_table
from flightid.study.response_settings import ResponseSettings
from flightid.study.structure_settings import NARX, SUBSPACE, StructureSettings, read_structure

COHERENT, UNBROKEN = "coherent", "unbroken"
"""Responses by coherence: over all coherent frequencies, or over the widest band without a gap."""
METHODS = {NARX: "orthogonal_least_squares", SUBSPACE: "subspace"}
"""How a structure is fitted; the others by prediction errors."""


@dataclass(frozen=True)
class ParameterOverride(Options):
    """What a study says of one parameter of a model, over the model's own file."""

    value: float | None = option(None, doc="Where it starts, or stays.")
    minimum: float | None = option(None, doc="Lower bound.")
    maximum: float | None = option(None, doc="Upper bound.")
    free: bool | None = option(None, doc="Whether it is estimated.")
    tie: str | None = option(None, doc="Formula of other parameters that gives its value.")


@dataclass(frozen=True, kw_only=True)
class AnyModel(Options):
    """What a table ``[[model]]`` says, with equations or without."""

    name: str = option(doc="Title in the report.")
    identify: tuple[str, ...] = option(doc="Records of the fit.")
    verify: tuple[str, ...] = option((), doc="Records kept for verification.")
    band_rad_s: tuple[float, float] | None = option(
        None, forms=(SPAN, NOTHING), unit="rad/s", above=0.0, doc="Band of its responses."
    )
    rivals: tuple[str, ...] = option(
        (), doc="Models to verify beside it: of the library, of a file, or of this study."
    )
    condition: str | None = option(None, doc="Flight condition, where the study compares several.")
    reference: str | None = option(
        None, doc="Library name or file of a model whose parameters and modes stand beside."
    )
    published: str | None = option(None, doc="File of published figures that stand beside.")
    tried: str = option("", doc="What was tried beside it: words that the report repeats.")


@dataclass(frozen=True, kw_only=True)
class ModelSettings(AnyModel):
    """One model to identify.

    Attributes
    ----------
    response, fit, check
        How responses are estimated, and how the model is fitted and verified.
    rival_sources : mapping of str to str
        Library name, or path of a model file, of each rival.
    figures : PublishedFigures or None
        Of the file `published`.
    structure : StructureSettings or None
        A structure without equations, whose order is looked for.
    """

    template: str | None = option(None, doc="Library name or file of a model; or a structure.")
    axis: str | None = option(None, doc="Axis of a library model that is written for any.")
    joint: tuple[str, ...] = option(
        (), doc="Records of a joint fit; those of identify then give the responses alone."
    )
    responses: tuple[str, ...] = option(
        (),
        doc="Responses of the fit as output/input; or 'coherent': those with coherence, over all "
        "such frequencies; or 'unbroken': over the widest band without a gap; default: its own.",
    )
    outputs: tuple[str, ...] = option((), doc="Outputs that are fitted; default: all.")
    parameters: Mapping[str, ParameterOverride] = option(
        default_factory=dict, doc="Overrides by parameter."
    )
    keep: tuple[str, ...] = option((), doc="Parameters that a reduction leaves in.")
    drop: tuple[str, ...] = option((), doc="Parameters that a reduction takes out first.")
    reduce: bool = option(True, doc="The reduction that the study asks for is meant for it.")
    values_from: Mapping[str, tuple[str, ...]] = option(
        default_factory=dict, doc="Parameters that start at another model's estimates, by model."
    )
    qualities: Options = option(
        default_factory=QualityCase,
        forms=(part_of(QualityCase, ONE),),
        doc="Case of the standard, where it is not the study's.",
    )
    response: ResponseSettings = field(default_factory=ResponseSettings)
    fit: FitSettings = field(default_factory=FitSettings)
    check: VerifySettings = field(default_factory=VerifySettings)
    rival_sources: Mapping[str, str] = field(default_factory=dict)
    figures: PublishedFigures | None = None
    structure: StructureSettings | None = None

    @property
    def segments(self) -> tuple[str, ...]:
        """Every record that the model uses."""
        beside = (
            (*self.structure.select, *(self.structure.coherence or ())) if self.structure else ()
        )
        return (*self.identify, *self.joint, *self.verify, *beside)

    @property
    def unfitted(self) -> tuple[str, ...]:
        """Records that choose a structure or verify, and are not fitted."""
        return (*(self.structure.select if self.structure else ()), *self.verify)

    @property
    def flown(self) -> tuple[str, ...]:
        """Records of the frequency responses."""
        return self.identify if self.structure is None else self.structure.coherence or ()

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
    response = read_table(ResponseSettings, reader.table("response"), response)
    check = read_table(VerifySettings, reader.table("check"), check)
    if "structure" in reader:
        return _without_equations(reader, folder, response=response, check=check)
    fit = read_fit(reader.table("fit"), fit)
    made = read_table(ModelSettings, reader)
    if made.template is None:
        raise reader.error("template", "is missing", found="none", needed="a model, or structure")
    if bool(made.joint) != (fit.method == "joint"):
        problem = "names records of a joint fit" if made.joint else "is missing"
        needed = 'method = "joint"' if made.joint else "records beside those of the responses"
        raise reader.error("joint", problem, found=fit.method, needed=needed)
    for name in ("keep", "drop", "reduce"):
        if name in reader and not reduced:
            raise reader.error(name, "has no meaning here", found="no [reduce]", needed="[reduce]")
    made = replace(
        made,
        template=placed(folder, made.template),
        band_rad_s=_band(made, reader, response if fit.on_responses else None),
        reduce=made.reduce and reduced,
        response=response,
        fit=fit,
        check=check,
    )
    return _beside(made, folder)


def _without_equations(
    reader: TableReader, folder: Path, *, response: ResponseSettings, check: VerifySettings
) -> ModelSettings:
    own = read_own(AnyModel, reader)
    structure = read_structure(reader, own.identify)
    reader.finish()
    # Only a response needs a band: without one no coherence is shown, and all inputs are kept.
    responds = "coherence" in reader or own.band_rad_s or response.band_rad_s
    made = ModelSettings(
        **vars(own),
        reduce=False,
        response=response,
        fit=FitSettings(METHODS.get(structure.structure, "prediction_error")),
        check=replace(check, without_equations=True),
        structure=structure,
    )
    return _beside(
        replace(made, band_rad_s=_band(made, reader, response) if responds else None), folder
    )


def _band(
    made: ModelSettings, reader: TableReader, response: ResponseSettings | None
) -> tuple[float, float] | None:
    """Band of the model, else that of its responses, which need one."""
    if response is None or made.band_rad_s is not None:
        return made.band_rad_s
    if response.band_rad_s is None:
        raise reader.error("band_rad_s", "is missing", found="none", needed="the responses' band")
    return response.band_rad_s


def _beside(made: ModelSettings, folder: Path) -> ModelSettings:
    """With what stands beside the estimates as it lies in the folder of the study."""
    return replace(
        made,
        rival_sources={rival: placed(folder, rival) for rival in made.rivals},
        reference=None if made.reference is None else placed(folder, made.reference),
        figures=None if made.published is None else read_published(folder / made.published),
    )


def placed(folder: Path, source: str) -> str:
    """A name of what is shipped as it is, a TOML file beside the study."""
    return str(folder / source) if source.endswith(".toml") else source
