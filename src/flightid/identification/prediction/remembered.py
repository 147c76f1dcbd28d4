"""What a fit was told of states, biases and inputs: its model is predicted the same way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flightid.frozen import dataclass
from flightid.identification.records.options import ESTIMATE, MEASURED, TRIM, InitialState
from flightid.identification.records.record_parameters import with_record_values
from flightid.models import StateSpaceModel
from flightid.models.model import model_of
from flightid.record import Record
from flightid.record.chosen_hold import DECLARED, RECORDED, SEEN
from flightid.record.digest import TRAINING, RecordDigest
from flightid.record.hold import HOLDS, InputHold

WORDS = (ESTIMATE, MEASURED, TRIM)


@dataclass(frozen=True)
class StartChoice:
    """What was told; None where nothing was.

    Attributes
    ----------
    initial_state : {"estimate", "measured", "trim"} or None
        Numbers by state belong to the records of the fit and are not carried on.
    output_bias, input_bias : bool or None
        Whether any was free.
    record_parameters : tuple of str
        Parameters that each record has for itself.
    hold : {"zero", "first", "band_limited"} or None
        What inputs did between samples, where the fit was told or its records knew.
    assumed_hold : {"zero", "first", "band_limited"} or None
        What the fit took where nobody knew.
    """

    initial_state: str | None = None
    output_bias: bool | None = None
    input_bias: bool | None = None
    record_parameters: tuple[str, ...] = ()
    hold: InputHold | None = None
    assumed_hold: InputHold | None = None


def remembered(source: object) -> StartChoice:
    """What a fit, or the model in its file, was told; nothing for a model that no fit made.

    Example
    -------
    >>> remembered(object())  # doctest: +NORMALIZE_WHITESPACE
    StartChoice(initial_state=None, output_bias=None, input_bias=None, record_parameters=(),
    hold=None, assumed_hold=None)
    """
    told, inputs = (_table(provenance_entry(source, key)) for key in ("told", "inputs"))
    start = told.get("initial_state")
    biases = {
        name: None if told.get(name) is None else bool(told[name])
        for name in ("output_bias", "input_bias")
    }
    own = tuple(told.get("record_parameters", ()))
    known = inputs.get("hold_from") in (DECLARED, RECORDED, SEEN)
    hold = inputs.get("hold") if inputs.get("hold") in HOLDS else None
    start = start if start in WORDS else None
    return StartChoice(
        start,
        **biases,
        record_parameters=own,
        hold=hold if known else None,
        assumed_hold=None if known else hold,
    )


def start_of_runs(source: object, asked: InitialState | None) -> InitialState:
    """Where free runs begin: one rule for models of every kind, whatever method fitted them.

    As the user says; else with the word that the fit was told; else as the model declares (a free
    initial value is solved for); else solved for at the start of each record, as output error does.

    Parameters
    ----------
    source : Fit or model
        In continuous time.
    asked : str, mapping or None
        The user's word.

    Example
    -------
    >>> start_of_runs(object(), None), start_of_runs(object(), "trim")
    ('estimate', 'trim')
    """
    told = asked or remembered(source).initial_state
    if told is not None and (asked or told != ESTIMATE):
        return told
    model = model_of(source)
    if not isinstance(model, StateSpaceModel) or not model.initial:
        return ESTIMATE
    # Runs of a linear model are told departures from its trim.
    trim = model.trim if model.is_linear else {}
    return {
        name: model.initial[name].value - trim.get(name, 0.0)
        if name in model.initial and not model.initial[name].free
        else ESTIMATE
        for name in model.states
    }


def of_record(source: object, model: object, record: Record) -> object:
    """The model with what a record holds of the parameters that a fit was told to be its own.

    Example
    -------
    >>> of_record(None, 1.0, None)
    1.0
    """
    names = remembered(source).record_parameters
    if not names or not isinstance(model, StateSpaceModel):
        return model
    return with_record_values(model, record, names)


def training_digests(source: object) -> list[RecordDigest]:
    """Of the records behind a fit, or behind the model in its file; none where nothing tells."""
    entry = provenance_entry(source, TRAINING)
    return [RecordDigest.from_dict(each) for each in entry] if isinstance(entry, list) else []


def share_samples(source: object, other: object) -> bool:
    """Whether two models were fitted to the same samples, whose noise then moves both."""
    known = training_digests(other)
    return any(mine.overlaps(each) for mine in training_digests(source) for each in known)


def provenance_entry(source: object, key: str) -> object:
    """What the provenance of a fit, or of the model in its file, holds; None where nothing."""
    estimated = getattr(model_of(source), "estimated", None)
    for holder in (source, estimated):
        known = getattr(holder, "provenance", None)
        if isinstance(known, Mapping) and key in known:
            return known[key]
    return None


def _table(entry: object) -> Mapping[str, Any]:
    return entry if isinstance(entry, Mapping) else {}
