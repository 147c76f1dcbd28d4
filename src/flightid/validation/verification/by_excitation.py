"""What a model predicts of the part of an output that follows what was injected.

In a loop inputs answer gusts: a free run from them errs by the whole of what gusts would do with
the loop open, which is large for a right model. What was injected knows no gust. Of a right model
the error holds nothing that follows it; of a wrong one it holds as much of the injected answer as
the model misses (`injected_bands`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.prediction.request import FREE_RUN
from flightid.identification.prediction.result import Prediction
from flightid.uncertainty.several_tests import holm_adjusted
from flightid.validation.verification.injected_bands import (
    SURE,
    InjectedBands,
    Powers,
    injected_bands,
    smooth_miss,
)

Array = NDArray[np.float64]
CODE = "excitation-refutes"
EXCITED = 0.003
"""Of the strongest band of an excitation: below it there is nothing that could be followed."""
FEWEST_BANDS = 3
FALSE_ALARMS = 0.001
"""Share of right models of which a miss is said."""
WITHIN, MATERIAL = 0.25, 0.1
"""Shares (rms) of the answer to what was injected: missed at most so much, a model is confirmed; at
least so much, it is refuted."""
WRONG = "look for what this output lacks: an input's gain, lag or delay"
LARGER = "verify on a record with a larger or longer injection, or in calmer air"


@dataclass(frozen=True)
class FollowedPart:
    """What follows an injection, and what a model misses of it.

    Attributes
    ----------
    missed, most : float
        Miss over the answer, both rms and weighed by how far each band stands out of gusts: the
        least that these allow, and the most.
    everywhere : float
        The most of it where no band is weighed: gusts may hide slow ones.
    chance : float
        That noise alone makes as much of a miss.
    """

    missed: float
    most: float
    everywhere: float
    chance: float

    @property
    def is_refuted(self) -> bool:
        """Whether the model misses more than noise could make, and enough to matter."""
        return self.chance < FALSE_ALARMS and self.missed >= MATERIAL

    @property
    def is_confirmed(self) -> bool:
        """Whether it misses little, whatever noise did, in slow motion too."""
        return max(self.most, self.everywhere) <= WITHIN


def followed_parts(made: Sequence[Prediction]) -> dict[str, FollowedPart]:
    """What follows the injections of free runs, by output; none where nothing tells.

    Parameters
    ----------
    made : sequence of Prediction
        Of records that all hold an excitation, in a loop that is not declared open.

    Assumes
    -------
    Excitations that know nothing of gusts, and enter at a point from which the inputs hold them.

    Reference
    ---------
    Brillinger, *Time Series*, 1981, section 8.6 (coherence of neighbouring frequencies); Ljung,
    *System Identification*, 2nd ed., section 13.4.
    """
    names = set.intersection(*(set(each.measured.excitations) for each in made))
    is_open = all(each.measured.input_shape.loop == "open" for each in made)
    whole = all(each.horizon == FREE_RUN and each.diverged_at is None for each in made)
    if not names or is_open or not whole:
        return {}
    found = {name: _of_output(made, name, sorted(names)) for name in made[0].outputs}
    told = {name: each for name, each in found.items() if each is not None}
    if not told:
        return {}
    chances = holm_adjusted(np.array([each.chance for each in told.values()]))
    return {
        name: replace(each, chance=float(chance))
        for (name, each), chance in zip(told.items(), chances, strict=True)
    }


def unexcused(made: Sequence[Prediction], outputs: Sequence[str]) -> tuple[str, ...]:
    """Outputs whose errors inputs may be asked for: injections do not show that gusts made them."""
    told = followed_parts(made)
    return tuple(n for n in outputs if n not in told or told[n].chance < FALSE_ALARMS)


def _of_output(
    made: Sequence[Prediction], name: str, excitations: Sequence[str]
) -> FollowedPart | None:
    runs = [injected_bands(each, name, excitations) for each in made]
    told = [each for each in runs if each is not None]
    if not told:
        return None
    bands = InjectedBands.joined(told)
    heard = bands.where(bands.injected >= EXCITED * np.max(bands.injected, initial=0.0))
    if len(heard.injected) < FEWEST_BANDS:
        return None
    logs = np.log(np.maximum(heard.chance, np.finfo(float).tiny))
    anyhow = float(scipy.special.chdtrc(2 * len(logs), -2.0 * np.sum(logs)))
    weighed = _ends(heard.missed, heard.answer)
    plain = _ends(heard.missed.times(heard.back), heard.answer.times(heard.back))
    if weighed is None:
        return None
    *smooth, directed = smooth_miss(heard)
    chance = min(1.0, 2.0 * min(anyhow, directed))
    least, most = weighed
    return FollowedPart(max(least, *smooth), most, np.inf if plain is None else plain[1], chance)


def _ends(missed: Powers, answer: Powers) -> tuple[float, float] | None:
    """Least and most of a miss over its answer, rms; None where no answer stands out."""
    (miss, variance), (power, of_power) = missed.total, answer.total
    if power <= SURE * np.sqrt(of_power):
        return None
    scatter = SURE * float(np.sqrt(variance))
    least, most = (float(np.sqrt(max(miss + end, 0.0) / power)) for end in (-scatter, scatter))
    return least, most


def weighed_by_excitation(
    verdicts: Mapping[str | None, Finding], told: Mapping[str, FollowedPart]
) -> dict[str | None, Finding]:
    """Verdicts on free runs in a loop, by what the model misses of the injected answer.

    Parameters
    ----------
    verdicts : mapping of str or None to Finding
        That weigh the error, by output; None: of all together.
    told : mapping of str to FollowedPart
    """
    outputs = [name for name in verdicts if name is not None]
    if not told:
        return dict(verdicts)
    made = {name: _judged(verdicts[name], told.get(name)) for name in outputs}
    found: dict[str | None, Finding] = dict(verdicts) | dict(made.items())
    if None in verdicts:
        together = verdicts[None]
        if all(name in told for name in outputs):
            worst = next(
                (light for light in (Light.RED, Light.AMBER)
                 if any(each.light is light for each in made.values())), Light.GREEN,
            )  # fmt: skip
            said = "; judged by what follows the injection, output by output"
            together = replace(together, light=worst, message=together.message + said)
        found[None] = together
    return found


def _judged(finding: Finding, part: FollowedPart | None) -> Finding:
    if part is None:
        return finding
    answer = "of the answer to what was injected, as it stands out of gusts,"
    if part.is_refuted:
        said = (
            f"; {answer} the model misses {100.0 * part.missed:.2g} % at least "
            f"(p = {part.chance:.1g} by chance), and no gust makes that"
        )
        return replace(finding, light=Light.RED, message=finding.message + said, action=WRONG)
    if finding.light not in (Light.RED, Light.AMBER):
        return finding
    if part.is_confirmed:
        said = (
            "; inputs of a loop answer gusts, which this counts as errors: of the answer to what "
            "was injected the model "
            f"misses {100.0 * max(part.most, part.everywhere):.2g} % at most"
        )
        return replace(finding, light=Light.GREEN, message=finding.message + said, action="")
    said = (
        f"; inputs of a loop answer gusts, which this counts as errors; {answer} the model misses "
        f"up to {100.0 * part.most:.2g} %; gusts hide the rest"
    )
    return replace(finding, light=Light.AMBER, message=finding.message + said, action=LARGER)
