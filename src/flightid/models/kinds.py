"""The kinds of models: one line each, and models from and to plain dictionaries by it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, cast

from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.models.estimated import EstimateProvenance
from flightid.models.innovations.model import InnovationsModel
from flightid.models.linear.description import system_from_table
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.model import Model, model_of
from flightid.models.narx.description import narx_from_table
from flightid.models.narx.model import NarxModel
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.state_space.model import StateSpaceModel
from flightid.models.transfer.description import transfer_from_table
from flightid.models.transfer.model import TransferFunctionModel

GreyBoxModel = TransferFunctionModel | StateSpaceModel
"""Models with named parameters of physics, which a fit starts from."""


@dataclass(frozen=True)
class ModelKind:
    """One kind of model.

    Attributes
    ----------
    model : type
        Its class.
    read : callable
        The model from plain values, checked key by key.
    write : callable
        Plain values that `read` takes back, with its word under ``kind``.
    """

    model: type
    read: Callable[[Mapping[str, object]], Model]
    write: Callable[..., dict[str, object]]


KINDS: dict[str, ModelKind] = {
    "transfer": ModelKind(
        TransferFunctionModel, transfer_from_table, TransferFunctionModel.to_dict
    ),
    "state-space": ModelKind(StateSpaceModel, StateSpaceModel.from_dict, StateSpaceModel.to_dict),
    "polynomial": ModelKind(PolynomialModel, PolynomialModel.from_dict, PolynomialModel.to_dict),
    "innovations": ModelKind(
        InnovationsModel, InnovationsModel.from_dict, InnovationsModel.to_dict
    ),
    "narx": ModelKind(NarxModel, narx_from_table, NarxModel.to_dict),
    "linear": ModelKind(LinearSystem, system_from_table, LinearSystem.to_dict),
}
"""By the word under ``kind`` in a file."""


def model_from_description(content: Mapping[str, object]) -> Model:
    """Build a model from a dictionary such as a TOML file gives.

    Parameters
    ----------
    content : mapping
        Keys ``kind`` (default ``"transfer"``) and those that its reader takes; a model's
        ``to_dict`` writes them.

    Raises
    ------
    ModelError
        The kind is not known; a key is missing, unknown or of the wrong type, or the model
        contradicts itself.

    Example
    -------
    >>> model_from_description({
    ...     "kind": "transfer", "inputs": {"u": "1"}, "outputs": {"y": "1"},
    ...     "parameters": {"K": {"value": 2.0}}, "responses": {"y/u": {"gain": "K"}}})
    TransferFunctionModel('transfer functions', 1 response [y/u], 1 parameters, 1 free)
    """
    if "kind" not in content and {"states", "equations"} & set(content):
        raise ModelError(
            "the model does not say its kind",
            found="states or equations, but no key kind",
            needed='kind = "state-space" on its first line, before any [table]',
            action="docs/models.md shows a whole file",
        )
    word = content.get("kind", "transfer")
    kind = KINDS.get(word) if isinstance(word, str) else None
    if kind is None:
        known = ", ".join(map(repr, KINDS))
        raise ModelError("kind of model is not known", found=repr(word), needed=f"one of {known}")
    plain = dict(content)
    written = plain.pop("estimated", None)
    model = kind.read(plain)
    if written is None:
        return model
    if not isinstance(written, Mapping):
        raise ModelError("estimated must be a table", found=repr(written)[:80])
    estimated = EstimateProvenance.from_dict(written, list(model.parameters))
    return cast("Model", replace(cast("Any", model), estimated=estimated))


def model_to_description(source: object) -> dict[str, object]:
    """Plain values of a model with its kind, which `model_from_description` reads.

    Of a fit, and of a model that came from the file of one, also what was known of its parameters.

    Raises
    ------
    ModelError
        This is no model.
    """
    model = model_of(source)
    for kind in KINDS.values():
        if isinstance(model, kind.model):
            known = getattr(source, "estimated", None)
            table = kind.write(model)
            return table if known is None else {**table, "estimated": known.to_dict()}
    raise ModelError(
        "this cannot be written as a model",
        found=type(model).__name__,
        needed="a model, or a fit of one",
    )
