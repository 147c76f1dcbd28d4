"""Names in a study file that refer to each other: models to records, each name once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

from flightid.errors import StudyError
from flightid.study.model_settings import ModelSettings


class NamedEntry(Protocol):
    """What a study file names."""

    @property
    def name(self) -> str:
        """Its name."""


class ModelEntry(NamedEntry, Protocol):
    """A model of either kind."""

    @property
    def identify(self) -> tuple[str, ...]:
        """Records of the fit."""

    @property
    def verify(self) -> tuple[str, ...]:
        """Records of the verification."""

    @property
    def segments(self) -> tuple[str, ...]:
        """Every record that it uses."""


def require_references(
    sources: Sequence[NamedEntry], models: Sequence[ModelEntry], *, kind: str
) -> None:
    """Check that names are unique and that models refer to what is there.

    Parameters
    ----------
    sources : sequence
        Segments of the log, or records from files.
    models : sequence
        All models.
    kind : {"segment", "record"}
        What the sources are called.

    Raises
    ------
    StudyError
        No model, a name twice, an unknown name, or a model that is verified on data it has seen.
    """
    if not models:
        raise StudyError("study file: nothing to identify", needed="a [[model]]")
    _require_unique(kind, sources)
    _require_unique("model", models)
    known = sorted(source.name for source in sources)
    for model in models:
        for name in model.segments:
            if name not in known:
                raise StudyError(
                    f"study file, model {model.name!r}: there is no such {kind}",
                    found=repr(name),
                    needed="one of " + ", ".join(map(repr, known)),
                )
        both = set(model.identify) & set(model.verify)
        if both:
            raise StudyError(
                f"study file, model {model.name!r}: a model is verified on data it has seen",
                found=", ".join(sorted(both)),
                needed=f"{kind}s that the fit does not use",
            )


def require_conditions(models: Sequence[ModelSettings]) -> None:
    """Check that each flight condition is of one model.

    Raises
    ------
    StudyError
        Two models name the same.
    """
    words = [model.condition for model in models if model.condition]
    if len(set(words)) < len(words):
        raise StudyError(
            "study file: two models are of one flight condition",
            found=", ".join(words),
            needed="another `condition` for each model",
        )


def _require_unique(kind: str, named: Iterable[NamedEntry]) -> None:
    names = [item.name for item in named]
    for name in names:
        if names.count(name) > 1:
            raise StudyError(f"study file: two [[{kind}]]s have one name", found=repr(name))
