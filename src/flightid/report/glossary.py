"""Plain words for what headings say, shown on hover."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

GLOSSARY = {
    "average cost": "How far a model lies from the measured responses: below 50 nearly the same, "
    "above 100 not acceptable (Tischler and Remple).",
    "worst free-run fit": "Share of an unseen motion that the model predicts without looking, "
    "in the record that it predicts worst.",
    "worst TIC": "Theil's inequality coefficient: 0 is a perfect prediction, below 0.25 to 0.30 is "
    "good.",
    "J_rms": "Root mean square of prediction errors over all outputs.",
    "coherence": "Share of the output's power that the input explains, frequency by frequency.",
    "phase margin": "Delay that the loop stands before it oscillates, as an angle at crossover.",
    "phase margin as flown": "The same with the gains of the log.",
    "gain margin": "How much the loop's gain may grow before it oscillates.",
    "gain margin as flown": "The same with the gains of the log.",
    "crossover": "Frequency up to which a loop works against errors.",
    "sensitivity peak": "How much the loop makes its worst disturbance larger.",
    "damping": "1 is a motion that dies without swinging, below 0 one that grows.",
    "insensitivity": "How far a parameter may move before the cost notices, percent of it.",
    "Cramér–Rao": "Least standard error that the data allow, percent of the value.",
    "chance": "Probability of so large a difference between equal truths.",
    "Theil coefficient": "0 is a perfect prediction, 1 none; below 0.25 to 0.30 is good.",
    "standard error": "Deviation of the estimate from flight to flight alike, by the data's noise.",
    "objective over the best": "Cost of this minimum over that of the one that was taken.",
    "rms error": "Root mean square of measured less predicted.",
    "mean square error": "Mean square of measured less predicted.",
    "fit": "100 % is a perfect prediction, 0 % no better than the mean of what was measured.",
    "free-run fit": "The same of a prediction from the inputs alone.",
    "free-run rms": "Root mean square error of a prediction from the inputs alone.",
    "variance accounted for": "Share of the output's power that the prediction explains.",
    "R²": "Share of the output's variance that the prediction explains; 1 is all.",
    "residual tests passed": "Whether what the model leaves is noise, that neither the inputs nor "
    "its own past foretell.",
    "nominal": "Of the model as it was estimated.",
    "worst": "Of the worst vehicle that the data still allow.",
    "flown, worst": "The same with the gains of the log.",
    "first step": "Gains to fly first: the way to the new ones is taken in safe steps.",
    "least phase margin": "Of the worst vehicle that the data allow: delay that the loop stands, "
    "as an angle at crossover.",
    "least gain margin": "Of the worst vehicle: how much the loop's gain may grow.",
    "half way after": "From the step to half of the level that it reaches.",
    "rises in": "From a tenth to nine tenths of the level that the step reaches.",
    "overshoots by": "How far the step goes beyond what was asked; beyond its level where that is "
    "more than a tenth off.",
    "settles in": "Time after which the step stays within a tenth of its level.",
    "reaches": "Share of what was asked that the step reaches in the time that is read.",
    "phase delay": "Delay of slow set-points: phase over frequency.",
    "-3 dB": "Frequency up to which set-points are followed by seven tenths or more.",
    "-90 deg": "Frequency at which the answer lags by a quarter of a cycle.",
    "-180 deg": "Frequency at which the answer is turned round.",
    "f_n": "Frequency at which the mode would swing without damping.",
    "ω_n": "The same in radians a second.",
    "ζ": "Damping ratio: 1 dies without swinging, 0 swings for good, below 0 grows.",
    "period": "Time of one swing.",
    "time constant": "Time in which the motion falls to 37 %.",
    "to half": "Time in which the motion falls to half.",
    "to double": "Time in which the motion grows to twice.",
    "natural frequency": "Frequency at which the mode would swing without damping.",
    "jitter": "Scatter of the time between two samples.",
    "correlation": "1: the two channels move alike, 0: they have nothing in common.",
    "na": "Past outputs that the model takes.",
    "nb": "Past inputs that the model takes.",
    "nc": "Terms of the noise's moving average.",
    "nd": "Terms of the noise's own memory.",
    "nf": "Poles from input to output.",
    "nk": "Samples that the output waits for the input.",
    "loss": "Mean square of one-step prediction errors.",
    "FPE": "Akaike's final prediction error: the loss, with a price for each coefficient.",
    "AIC": "Akaike's criterion; the smallest is the best balance of fit and size.",
    "AICc": "Akaike's criterion for short records; the smallest is the best.",
    "BIC": "Bayesian criterion; the smallest is the best, and it prefers small models.",
    "MDL": "Least description length; as BIC.",
    "lags outside": "Lags at which what the model leaves is more than noise.",
    "pointwise band": "What noise stays within at one lag, in 95 of 100 cases.",
    "simultaneous band": "What noise stays within at all lags at once, in 95 of 100 cases.",
    "degrees of freedom": "Independent numbers in the test.",
    "TIC": "Theil's inequality coefficient: 0 is a perfect prediction, below 0.25 to 0.30 is good.",
}
"""Words by heading."""
CHANNELS = {
    "p": ("rad/s", "roll rate"),
    "q": ("rad/s", "pitch rate"),
    "r": ("rad/s", "yaw rate"),
    "phi": ("rad", "roll angle"),
    "theta": ("rad", "pitch angle"),
    "psi": ("rad", "heading"),
    "tau_phi": ("1", "roll command"),
    "tau_theta": ("1", "pitch command"),
    "tau_psi": ("1", "yaw command"),
}
"""Unit and words of channels, by the names that logs have here."""


def channel_words(name: str, unit: str) -> str:
    """A channel with its plain words, where name and unit are those of logs; else its name.

    Example
    -------
    >>> channel_words("tau_phi", "1"), channel_words("p", "V")
    ('tau_phi (roll command)', 'p')
    """
    known, words = CHANNELS.get(name, ("", ""))
    return f"{name} ({words})" if words and known == unit else name


def symbols_in(sections: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """What parameters mean, by the tables of a document that say it.

    Parameters
    ----------
    sections : iterable of mapping
        Plain values of a content tree.
    """
    found: dict[str, str] = {}
    for section in sections:
        for block in section["blocks"]:
            names = [each["name"] for each in block["columns"]] if block["kind"] == "table" else []
            if {"parameter", "meaning"} <= {*names}:
                place, told = names.index("parameter"), names.index("meaning")
                for row in block["rows"]:
                    if row[told]:
                        found.setdefault(str(row[place]), str(row[told]))
        found = {**symbols_in(section["sections"]), **found}
    return found
