"""A hold that somebody vouches for: what the data and the samples say of the word, and what then.

The word stands in the bars, so that a right one gives bars of the right size. What rests on it is
said as an amount; where neither data nor samples bear it out, the light is not green.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.evidence.gather import ON_A_WORD
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.judged_again import parameters_judged_again
from flightid.identification.rival_holds import CHANCE, DOUBTFUL, NEGLIGIBLE, OtherHold, Rivals
from flightid.record.chosen_hold import DECLARED, RECORDED, SEEN, ChosenHold
from flightid.record.history import FLOWN
from flightid.record.hold import BETWEEN, HOLDS, InputHold
from flightid.record.repeats import found_staircase, is_rough, stands_still

Array = NDArray[np.float64]
MATERIAL = 0.66
"""Standard errors by which bars reach a rival with a fifth more of length; beyond, it is a word."""
COULD_TELL = 1.0
"""Expected gain of likelihood from which bars of rough samples reach steps that fit better."""
AUDIBLE, MILD = 0.3, 1.0
"""Expected gain of likelihood from which data have a say beside samples that stand still and jump,
and standard deviations of a gain that 1 of 6 right words exceeds: bars reach the rival there. Amber
is what 1 of 24 exceeds: two witnesses, word and samples, are not doubted sooner than a word."""
UNPROVEN = "hold-unproven"
PROOF = (
    "prove it: let the same device send steps of several samples or two levels, or sample faster, "
    "so that the data can tell, or bring the autopilot's log; another declaration proves nothing"
)
WHOSE = {
    DECLARED: "as was declared", RECORDED: "as the records say", SEEN: "as their two levels say",
}  # fmt: skip


class Witness(Enum):
    """Who speaks for a hold that was told, where the data leave a rival open."""

    MAKER = "what made the inputs"
    SAMPLES = "the samples"
    NOBODY = "nobody"


def told(fit: Fit, held: ChosenHold, rivals: Rivals) -> tuple[Fit, ChosenHold]:
    """The fit under a hold that was told, and the hold with what is to be said of it.

    Parameters
    ----------
    fit : Fit
    held : ChosenHold
    rivals : Rivals
        Of that fit.
    """
    if not rivals.records:
        return fit, held
    others = _others(held.hold, rivals)
    known = rivals.under(others) if rivals.is_fed_back else _by_both(others, rivals)
    matter = [each for each in known if each.moved > NEGLIGIBLE]
    if not matter:
        return fit, held
    finding, reached = _judged(matter, held, rivals)
    fit = widened(noted(fit, known), reached)
    return fit, held if finding is None else replace(held, findings=(*held.findings, finding))


def _by_both(others: Sequence[InputHold], rivals: Rivals) -> list[OtherHold]:
    """By how much the method's own estimates move, and how likely the records make each hold.

    A wrong hold bends every estimator its own way: a fit of responses can lie to the other side of
    the truth than one of the same samples in time.
    """
    known = rivals.by_likelihood(others)
    if not any(each.moved > NEGLIGIBLE for each in known):
        return known
    return [*rivals.as_fitted(known), *(each for each in known if not each.is_likely)]


def _others(hold: InputHold, rivals: Rivals) -> list[InputHold]:
    """Holds to try: of a log's rows, which are its loop's steps, no straight lines."""
    if rivals.logged:
        return ["band_limited" if hold == "zero" else "zero"]
    if rivals.is_fed_back:
        return ["first" if hold == "zero" else "zero"]
    return [each for each in HOLDS if each != hold]


def _judged(
    matter: Sequence[OtherHold], held: ChosenHold, rivals: Rivals
) -> tuple[Finding | None, list[OtherHold]]:
    """What to say of a word, and the rivals that bars shall reach."""
    whose = WHOSE[held.source]
    doubts = [each for each in matter if each.doubts]
    if doubts:
        best = max(doubts, key=lambda each: each.gain or 0.0)
        if held.hold == "band_limited" and _low_passed(rivals):
            return low_passed_otherwise(best), [best]
        return contradicted(best, held.hold, whose), [best]
    # Samples that stand still and jump are a witness of their own: less than odds of 400 to 1
    # against steps does not outweigh them.
    steps = next((each for each in matter if each.hold == "zero" and each.is_likely), None)
    by_maker = rivals.made_by("simulate")
    if steps is not None and not by_maker:
        finding = steps_told_otherwise(steps, rivals, whose)
        if finding is not None:
            stood = "stands still" in finding.message
            likelier = steps.expected >= COULD_TELL and (steps.gain or 0.0) > 0.0
            return finding, [steps] if stood or likelier else []
    # What is ruled out by less than a decisive likelihood is still said, in green.
    likely = [each for each in matter if each.is_likely]
    if by_maker or not likely:
        return None, []
    if held.hold == "zero" and witness_of("zero", rivals) is Witness.SAMPLES:
        return _on_samples(likely, whose)
    furthest = max(likely, key=lambda each: (each.is_open, each.moved))
    return _on_a_word(furthest, held.hold, rivals, whose)


def _on_samples(likely: Sequence[OtherHold], whose: str) -> tuple[Finding | None, list[OtherHold]]:
    """Steps that samples bear out: they stand unless data that have a say lean elsewhere."""
    leaning = [each for each in likely if _leans(each)]
    if not leaning:
        return None, []
    best = max(leaning, key=lambda each: each.gain or 0.0)
    if not _leans(best, CHANCE):
        # Of right words that two witnesses bear out, 1 of 6 comes here: no doubt, longer bars.
        said = (
            f"inputs are {BETWEEN['zero']} between samples {whose}, as samples that stand still "
            f"and jump bear out; were they {BETWEEN[best.hold]}, which fit about as well, "
            f"{best.parameter} would be {best.moved:.2g} standard errors away{best.by}, which the "
            "intervals reach"
        )
        return Finding(ON_A_WORD, Light.GREEN, said), [best]
    finding = Finding(
        UNPROVEN,
        Light.AMBER,
        f"inputs are {BETWEEN['zero']} between samples {whose}, as samples that stand still and "
        f"jump bear out, but the outputs fit {BETWEEN[best.hold]} as well or better (log-"
        f"likelihood {best.gain:+.2g}): were they so, {best.parameter} would be "
        f"{best.moved:.2g} standard errors away{best.by}",
        PROOF,
    )
    return finding, [best] if best.expected >= COULD_TELL and (best.gain or 0.0) > 0.0 else []


def _leans(other: OtherHold, deviations: float = MILD) -> bool:
    """Whether data that have a say are as good for it by chance beyond so many deviations alone."""
    chance = deviations * math.sqrt(2.0 * other.expected) - other.expected
    return other.gain is not None and other.expected >= AUDIBLE and other.gain > chance


def _on_a_word(
    other: OtherHold, taken: InputHold, rivals: Rivals, whose: str
) -> tuple[Finding | None, list[OtherHold]]:
    """What rests on a hold that the data neither bear out nor contradict."""
    witness = witness_of(taken, rivals)
    said = (
        f"inputs are {BETWEEN[taken]} between samples {whose}; the data cannot tell: were they "
        f"{BETWEEN[other.hold]}, {other.parameter} would be {other.moved:.2g} standard errors "
        f"away{other.by}"
    )
    if witness is not Witness.NOBODY or not other.is_open:
        return Finding(ON_A_WORD, Light.GREEN, said), []
    if other.moved <= MATERIAL:
        return Finding(ON_A_WORD, Light.GREEN, f"{said}, which the intervals reach"), [other]
    return (
        Finding(
            UNPROVEN,
            Light.AMBER,
            f"{said}; intervals are those of that word",
            PROOF,
        ),
        [],
    )


def witness_of(taken: InputHold, rivals: Rivals) -> Witness:
    """Who speaks for a word: the autopilot whose rows they are, a loop's computer, or samples.

    Samples that stand still and jump speak for steps, smooth ones for a smooth input; nothing in
    samples speaks for straight lines. A loop that is closed in samples holds its inputs.
    """
    if rivals.logged or (taken == "first" and rivals.made_by(FLOWN)):
        return Witness.MAKER
    if taken == "zero" and rivals.is_fed_back:
        return Witness.MAKER
    samples = [record[name] for record in rivals.records for name in rivals.fit.model.inputs]
    return Witness.SAMPLES if _bear_out(taken, samples) else Witness.NOBODY


def _bear_out(taken: InputHold, samples: Iterable[Array]) -> bool:
    moving = [each for each in samples if np.ptp(each) > 0.0]
    if taken == "zero":
        return all(found_staircase(each) is not None or stands_still(each) for each in moving)
    if taken == "band_limited":
        return not any(is_rough(each) or found_staircase(each) is not None for each in moving)
    return False


def steps_told_otherwise(steps: OtherHold, rivals: Rivals, whose: str) -> Finding | None:
    """Steps in samples that were told as anything else; none where a log shows what it sampled."""
    if rivals.logged:
        return None
    for record in rivals.records:
        for name in rivals.fit.model.inputs:
            stairs: object = found_staircase(record[name])
            alike = steps.is_open and (steps.gain or 0.0) > -DOUBTFUL
            if stairs is None and alike and is_rough(record[name]):
                stairs = "moves from sample to sample as a device's steps do, and steps fit alike"
            if stairs is not None:
                return Finding(
                    "hold-contradicted",
                    Light.AMBER,
                    f"inputs are {BETWEEN[rivals.assumed]} between samples, {whose}, yet {name} of "
                    f"{record.name!r} {stairs}; as steps, {steps.parameter} is "
                    f"{steps.moved:.2g} standard errors away{steps.by}",
                    "declare hold='zero' if the vehicle got these steps",
                )
    return None


def noted(fit: Fit, known: Sequence[OtherHold]) -> Fit:
    """The fit with what other holds would make of it in its provenance."""
    sizes = {
        each.hold: {
            "parameter": each.parameter,
            "moved": each.moved,
            "gain": each.gain,
            "shift": dict(zip(fit.names, each.shift, strict=True)),
        }
        for each in known
    }
    return replace(fit, provenance={**fit.provenance, "other_holds": sizes})


def contradicted(best: OtherHold, taken: InputHold, whose: str) -> Finding:
    """A hold that the data speak against."""
    return Finding(
        "hold-contradicted",
        Light.AMBER,
        f"the data say that inputs are {BETWEEN[best.hold]} between samples, not {BETWEEN[taken]} "
        f"{whose}: log-likelihood {best.gain:.3g} higher, {best.parameter} {best.moved:.2g} "
        f"standard errors away{best.by}",
        f"declare hold={best.hold!r} for the record, or the hold that is true; a delay of half a "
        "sample that the model lacks looks alike",
    )


def low_passed_otherwise(best: OtherHold) -> Finding:
    """The same of inputs that a low-pass made smooth: no other word is true of them."""
    return Finding(
        "hold-contradicted",
        Light.AMBER,
        "inputs were low-passed to a coarser base, yet outputs fit better as if they were "
        f"{BETWEEN[best.hold]} between samples: log-likelihood {best.gain:.3g} higher, "
        f"{best.parameter} {best.moved:.2g} standard errors away{best.by}",
        "fit the samples as they were stored, with the hold that was true of them; declare no "
        "other hold for these; a delay of half a sample that the model lacks looks alike",
    )


def _low_passed(rivals: Rivals) -> bool:
    """Whether a coarser base was made of an input of any record."""
    names = rivals.fit.model.inputs
    done = [step.options.get(name) for each in rivals.records for step in each.history
            for name in names]  # fmt: skip
    return any(isinstance(each, str) and each.startswith("low-pass") for each in done)


def widened(fit: Fit, others: Sequence[OtherHold]) -> Fit:
    """The fit whose bars reach what likely other holds would make of the estimates.

    What was said of its parameters is said again of these bars.
    """
    if fit.covariance is None:
        return fit
    shifts = np.array([each.shift for each in others if each.is_likely])
    covariance = fit.covariance + shifts.T @ shifts if len(shifts) else fit.covariance
    errors = dict(zip(fit.names, np.sqrt(np.diag(covariance)), strict=True))
    known = {
        name: replace(each, stderr=float(errors[name])) if name in errors else each
        for name, each in fit.parameters.items()
    }
    return parameters_judged_again(replace(fit, covariance=covariance, parameters=known))
