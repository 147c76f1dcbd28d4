"""A NARX model as portable C: the sum of its terms, with its lags as memory."""

from __future__ import annotations

from flightid.errors import OptionError
from flightid.export.c_source import CSource, Entry, Tables, rendered, step_of_samples
from flightid.models import NarxModel
from flightid.models.linear.hold_equivalent import Hold


def narx_source(
    model: NarxModel, name: str, stem: str, sample_time_s: float | None, hold: Hold
) -> CSource:
    """C of a NARX model, which does what `simulate` does: from rest at the training mean.

    Parameters
    ----------
    model : NarxModel
    name, stem : str
        Of the model, and of the files.
    sample_time_s : float or None
        None, or the model's own, s.
    hold : {"zero", "first"}
        Must be "zero": a sampled model reads its inputs at its samples alone.

    Returns
    -------
    CSource
        Its states are past outputs in deviations, and the samples until every lag is known.

    Raises
    ------
    OptionError
        Another sample time than the model's, or straight lines between samples.
    """
    step_s = step_of_samples(model.sample_time_s, sample_time_s)
    if hold == "first":
        raise OptionError(
            "a discrete model takes its inputs at its samples alone", found="hold='first'"
        )
    structure, scaling = model.structure, model.scaling
    lags = list(structure.lags)
    places = {lag: place for place, lag in enumerate(lags)}
    start = max((lag.lag for lag in lags), default=0)
    past = max((lag.lag for lag in lags if lag.channel == model.output), default=0)
    radial = [place for place, term in enumerate(model.terms) if term.centre]
    low, high = model.guard
    words: dict[str, object] = {
        "lags": [
            {
                "input": None if lag.channel == model.output else model.inputs.index(lag.channel),
                "back": lag.lag,
                "mean": float(scaling.mean[lag.channel]),
                "deviation": float(scaling.deviation[lag.channel]),
            }
            for lag in lags
        ],
        "products": [
            (
                float(weight),
                [places[lag] for lag, power in term.factors for _ in range(power)],
            )
            for term, weight in zip(model.terms, model.weights, strict=True)
            if not term.centre
        ],
        "centres": [list(map(float, model.terms[place].centre)) for place in radial],
        "radial_weights": [float(model.weights[place]) for place in radial],
        "kernel": structure.kernel or "gaussian",
        "beta": float(structure.beta),
        "low": low,
        "high": high,
        "output_mean": float(scaling.mean[model.output]),
        "output_deviation": float(scaling.deviation[model.output]),
        "equations": None,
        "depth": start + 2,
        "first_order": False,
    }
    memory = [Entry(f"{model.output}_lag_{k + 1}", "1") for k in range(past)]
    tables = Tables(
        (*memory, Entry("samples_until_all_lags_are_known", "1", float(start))),
        tuple(Entry(each, model.units.get(each, "1")) for each in model.inputs),
        (Entry(model.output, model.units.get(model.output, "1")),),
        (),
    )
    method = f"NARX, {len(model.terms)} terms of sampled lags, as it is"
    return rendered("narx.c.j2", name, stem, tables, step_s, hold, method, words)
