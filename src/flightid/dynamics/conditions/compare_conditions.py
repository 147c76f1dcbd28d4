"""Flight conditions side by side: parameters and modes, their ratios, and what really changed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy

from flightid.conventions import Light
from flightid.dynamics.conditions.black_box_numbers import black_box_numbers
from flightid.dynamics.conditions.ratios import SHARED_ERRORS, chance_of, holm, ratio_of
from flightid.dynamics.conditions.result import (
    ComparedMode,
    ComparedNumber,
    ConditionComparison,
)
from flightid.dynamics.modes.modes import modes
from flightid.dynamics.modes.result import Mode, Modes
from flightid.errors import ModelError, OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.identification.prediction.remembered import share_samples
from flightid.identification.uncertain_of import source_findings
from flightid.identification.uncertain_parameters import parameter_estimates
from flightid.models import StateSpaceModel, TransferFunctionModel
from flightid.uncertainty.estimate import Estimate, Reading

ALIKE = 0.3
"""Least common participation of two modes that are taken for the same one."""
FAR = 10.0
"""Cost of a pair of modes that cannot be the same."""
ONE_RECORD = "fitted to one record, whose noise moves both: nothing says what of it is a change"
NUMBERS = ("natural frequency", "damping ratio", "real")


@dataclass(frozen=True)
class _Condition:
    name: str
    values: dict[str, Reading]
    modes: Modes


def compare_conditions(sources: Mapping[str, object]) -> ConditionComparison:
    """Models of several flight conditions side by side.

    Parameters
    ----------
    sources : mapping of str to Fit or model
        Two or more by name of the condition, such as hover and cruise; the first is the base of all
        ratios. Black boxes have modes, steady gains and delays, and are compared with each other.

    Returns
    -------
    ConditionComparison
        Parameters that two or more share and modes that answer to each other, with the ratio to the
        base and its interval, and findings on what changed.

    Raises
    ------
    OptionError
        Fewer than two conditions.
    ModelError
        A source without named parameters beside one that has them, or without modes.

    Assumes
    -------
    Conditions identified from different flights, so that their errors are independent. Of models
    whose files or fits say that they were fitted to samples of the base, ratios have no interval
    and no difference is called a change. A change is called significant by Holm's rule: one false
    verdict among all parameters and modes together in 5 % of comparisons.

    Reference
    ---------
    Mettler, Tischler & Kanade, *J. American Helicopter Society* 47(1), 2002, tables 4 and 5 (last
    column); Fieller, *J. Royal Statistical Society B* 16 (1954), for the interval of a ratio.

    Example
    -------
    >>> import flightid as fid
    >>> found = compare_conditions({
    ...     "hover": fid.load_model("r50_hover"), "cruise": fid.load_model("r50_cruise")})
    >>> found
    ConditionComparison(hover, cruise: 29 common parameters, 5 common modes, 0 significant changes)
    >>> round(found["tau_s"].ratios["cruise"].value, 2)
    0.76
    """
    if len(sources) < 2:
        raise OptionError(
            "a comparison needs two conditions", found=", ".join(sources) or "none", needed="2"
        )
    black_boxes = not any(_is_named(source) for source in sources.values())
    conditions = [
        _Condition(name, black_box_numbers(source), modes(source))
        if black_boxes
        else _condition(name, source)
        for name, source in sources.items()
    ]
    first, *later = sources
    tied = frozenset(name for name in later if share_samples(sources[first], sources[name]))
    numbers = tuple(_numbers(conditions, tied))
    matched, alone = _match(conditions, tied)
    alone_parameters = {
        c.name: tuple(n for n in c.values if not any(n in o.values for o in conditions if o != c))
        for c in conditions
    }
    of_modes = [number for mode in matched for number in mode.numbers]
    significant = holm(
        {
            f"{number.name} {name}": chance
            for number in (*numbers, *of_modes)
            for name, chance in number.chances.items()
        }
    )
    findings = [
        *_changes(numbers, significant),
        *_changes(of_modes, significant),
        *_turned(conditions, matched),
        *(
            Finding("one-record", Light.UNKNOWN, f"{first} and {each}: {ONE_RECORD}")
            for each in tied
        ),
        *(
            replace(finding, message=f"{name}: {finding.message}")
            for name, source in sources.items()
            for finding in source_findings(source)
        ),
    ]
    return ConditionComparison(
        tuple(sources), numbers, tuple(matched), alone_parameters, alone, tuple(findings)
    )


def _is_named(source: object) -> bool:
    """Whether parameters have names that mean the same in another model."""
    model = source.model if isinstance(source, Fit) else source
    return isinstance(model, StateSpaceModel | TransferFunctionModel)


def _condition(name: str, source: object) -> _Condition:
    if not _is_named(source):
        raise ModelError(
            f"condition {name} has no named parameters",
            found=type(source.model if isinstance(source, Fit) else source).__name__,
            needed="a fit or model of transfer functions or equations",
            action="compare black boxes with each other, by their modes",
        )
    values: dict[str, Reading] = {
        key: p.as_reading() for key, p in parameter_estimates(source).items()
    }
    return _Condition(name, values, modes(source))


def _numbers(conditions: Sequence[_Condition], tied: frozenset[str]) -> Iterator[ComparedNumber]:
    names = dict.fromkeys(name for condition in conditions for name in condition.values)
    for name in names:
        there = {c.name: c.values[name] for c in conditions if name in c.values}
        if len(there) > 1:
            yield _compared(name, there, tied)


def _compared(name: str, there: dict[str, Reading], tied: frozenset[str]) -> ComparedNumber:
    """A number side by side; nothing is said of chance where one record's noise moves both."""
    base, *others = there
    ratios = {o: ratio_of(there[o], there[base], f"{name}, {o} over {base}") for o in others}
    for other, ratio in ratios.items():
        if other in tied and ratio.interval95 is not None:
            ratios[other] = Estimate(ratio.name, ratio.value, "1", None, SHARED_ERRORS)
    chances = {o: chance_of(there[o], there[base]) for o in others if o not in tied}
    known = {key: value for key, value in chances.items() if value is not None}
    return ComparedNumber(name, there, ratios, known)


def _match(
    conditions: Sequence[_Condition], tied: frozenset[str]
) -> tuple[list[ComparedMode], dict[str, tuple[str, ...]]]:
    """Modes of later conditions that answer to those of the first, and the rest."""
    conditions = [_Condition(c.name, c.values, _without_delays(c.modes)) for c in conditions]
    base, *others = conditions
    answers: dict[int, dict[str, Mode]] = {k: {base.name: m} for k, m in enumerate(base.modes)}
    alone: dict[str, tuple[str, ...]] = {}
    for other in others:
        cost = np.array([[_distance(a, b) for b in other.modes] for a in base.modes])
        rows, columns = scipy.optimize.linear_sum_assignment(cost)
        taken = set()
        for row, column in zip(map(int, rows), map(int, columns), strict=True):
            if cost[row, column] < FAR:
                answers[row][other.name] = other.modes.modes[column]
                taken.add(column)
        alone[other.name] = _told(m for k, m in enumerate(other.modes.modes) if k not in taken)
    alone[base.name] = _told(found[base.name] for found in answers.values() if len(found) == 1)
    names = [mode.name for mode in base.modes]
    matched = [
        _compared_mode(found, base.name, names.count(found[base.name].name) == 1, tied)
        for found in answers.values()
        if len(found) > 1
    ]
    return matched, alone


def _told(found: Iterable[Mode]) -> tuple[str, ...]:
    """Names; of a black box, whose modes are called after its output, what they are."""
    return tuple(m.name if m.participations else f"{m.name}, {m.place_words}" for m in found)


def _without_delays(found: Modes) -> Modes:
    """Modes with a counterpart in the s plane: delays of one sample have none."""
    return replace(found, modes=tuple(mode for mode in found if mode.eigenvalue is not None))


def _distance(first: Mode, second: Mode) -> float:
    """From common participation and place; `FAR` for modes that cannot be the same."""
    if first.is_pair != second.is_pair or not (first.eigenvalue and second.eigenvalue):
        return FAR
    if first.participations and second.participations:
        states = {p.state for p in first.participations}
        common = sum(min(first.share(state), second.share(state)) for state in states)
        if common < ALIKE:
            return FAR
    else:
        common = 1.0
    one, other = first.eigenvalue, second.eigenvalue
    apart = abs(one - other) / max(abs(one), abs(other))
    return (1.0 - common) + apart


def _compared_mode(
    found: dict[str, Mode], base: str, is_alone: bool, tied: frozenset[str]
) -> ComparedMode:
    """A mode's numbers side by side; its frequency tells it from others of its name."""
    numbers = []
    pair, mode_name = found[base].is_pair, found[base].name
    if not is_alone and (root := found[base].eigenvalue) is not None:
        mode_name = f"{mode_name} at {abs(root) / (2.0 * math.pi):.3g} Hz"
    for name in NUMBERS:
        if pair == (name == "real"):
            continue
        there = {}
        for condition, mode in found.items():
            number = {q.name: q for q in mode.quantities}[name]
            there[condition] = number
        numbers.append(_compared(f"{mode_name}, {name}", there, tied))
    return ComparedMode(mode_name, found, tuple(numbers))


def _changes(numbers: Sequence[ComparedNumber], significant: set[str]) -> Iterator[Finding]:
    for number in numbers:
        base = next(iter(number.values))
        for name, ratio in number.ratios.items():
            if f"{number.name} {name}" not in significant:
                continue
            turned = ratio.value is not None and ratio.value < 0.0
            size = f", ratio {ratio.text}" if ratio.value is not None else ""
            yield Finding(
                "sign-changed" if turned else "changed",
                Light.AMBER if turned else Light.GREEN,
                f"{number.name}: {number.values[base].text} in {base}, "
                f"{number.values[name].text} in {name}{size}",
                "schedule what rests on it" if turned else "",
            )


def _turned(conditions: Sequence[_Condition], matched: Sequence[ComparedMode]) -> Iterator[Finding]:
    for mode in matched:
        grows = {name: (m.eigenvalue or 0.0).real > 0.0 for name, m in mode.modes.items()}
        if len(set(grows.values())) > 1:
            unstable = ", ".join(name for name, growing in grows.items() if growing)
            yield Finding(
                "stability-changed",
                Light.AMBER,
                f"{mode.name}: unstable in {unstable}, stable in the rest",
                "check the loop in each condition",
            )
    stable = {c.name: c.modes.is_stable for c in conditions}
    if len(set(stable.values())) > 1:
        unstable = ", ".join(name for name, held in stable.items() if not held)
        yield Finding(
            "stability-changed", Light.AMBER, f"unstable in {unstable}, not in the rest",
            "check the loop in each condition",
        )  # fmt: skip
