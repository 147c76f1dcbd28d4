"""Findings: coded statements about data or results, each with a sentence on what to do."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, replace
from typing import Protocol, TypeVar

from flightid.conventions import Light
from flightid.frozen import dataclass
from flightid.surface import spoken

GRAVITY = (Light.RED, Light.AMBER, Light.UNKNOWN, Light.GREEN)
FALL, DIVERGES = "tipped-over", "diverges"
"""Code of a fall; beginning of codes of what grows, unasked, until a flight ends."""
FIRST = ("scale-contradicted", FALL, *(f"{DIVERGES}-{axis}" for axis in ("roll", "pitch", "yaw")))
"""Codes of what comes before all advice on a log: another flight would meet it again."""
CAUSES = (
    "saturated", "motor-at", "motors-unbalanced", "yaw-trimmed", "vibration", "accelerometer-clips",
)  # fmt: skip
"""Beginnings of codes that may tell why a vehicle fell: they come right after the fall."""


class Statement(Protocol):
    """Whatever states a fact under a code."""

    @property
    def code(self) -> str:
        """Stable identifier."""
        ...

    @property
    def message(self) -> str:
        """What was found."""
        ...


Said = TypeVar("Said", bound=Statement)


@dataclass(frozen=True)
class Finding:
    """One verdict with its reason.

    Attributes
    ----------
    code : str
        Stable identifier, for example ``"rate-too-low"``; scripts test this, people read the rest.
    light : Light
        Verdict.
    message : str
        What was found, with numbers and units.
    action : str
        What to do about it; empty where nothing is to be done.

    Example
    -------
    >>> print(Finding("rate-too-low", Light.RED, "RATE is logged at 10 Hz", "set LOG_BITMASK"))
    [red] RATE is logged at 10 Hz — set LOG_BITMASK
    """

    code: str
    light: Light
    message: str
    action: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "message", spoken(self.message))
        object.__setattr__(self, "action", spoken(self.action))

    def __str__(self) -> str:
        """Verdict, message and action on one line."""
        return f"[{self.light.words}] {self.message}" + (f" — {self.action}" if self.action else "")

    def to_dict(self) -> dict[str, str]:
        """Plain values.

        Returns
        -------
        dict of str to str
            Keys ``code``, ``light``, ``message``, ``action``.
        """
        return {key: str(value) for key, value in asdict(self).items()}


def worst(findings: list[Finding] | tuple[Finding, ...]) -> Light:
    """The worst light among findings; green where there are none.

    Example
    -------
    >>> worst([Finding("a", Light.GREEN, "fine"), Finding("b", Light.AMBER, "doubtful")]).value
    'amber'
    """
    lights = {finding.light for finding in findings}
    return next((light for light in GRAVITY if light in lights), Light.GREEN)


def urgency(finding: Finding, fallen: bool = False) -> tuple[int, int]:
    """What findings of one flight are sorted by where a reader does the first first.

    Parameters
    ----------
    finding : Finding
    fallen : bool
        Whether the vehicle fell: what may have made it fall then comes before advice on logging and
        on further flights, which would fall as well.

    Example
    -------
    >>> fell, short = Finding("tipped-over", Light.AMBER, ""), Finding("too-short", Light.RED, "")
    >>> [each.code for each in sorted([short, fell], key=urgency)]
    ['tipped-over', 'too-short']
    """
    if finding.code in FIRST:
        return FIRST.index(finding.code), GRAVITY.index(finding.light)
    caused = fallen and finding.light is not Light.GREEN and finding.code.startswith(CAUSES)
    return len(FIRST) + (not caused), GRAVITY.index(finding.light)


def in_order(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings of one flight, what is to be done first first: the one place that orders them.

    Example
    -------
    >>> codes = ("rate-too-low", "saturated", "tipped-over")
    >>> told = [Finding(code, Light.AMBER, "") for code in codes]
    >>> [each.code for each in in_order(told)]
    ['tipped-over', 'saturated', 'rate-too-low']
    """
    known = tuple(findings)
    fallen = any(each.code == FALL for each in known)
    return tuple(sorted(known, key=lambda each: urgency(each, fallen)))


def worst_last(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings from green to red, where eyes are on a terminal; equals in their order.

    Example
    -------
    >>> told = [Finding("a", Light.RED, "no"), Finding("b", Light.GREEN, "yes")]
    >>> [each.code for each in worst_last(told)]
    ['b', 'a']
    """
    return in_order(tuple(findings)[::-1])[::-1]


def unsaid(findings: Iterable[Said], others: Iterable[Said]) -> list[Said]:
    """Findings whose fact no other one states: not its code, nor its sentence up to the numbers.

    Example
    -------
    >>> known = Finding("saturated", Light.AMBER, "C3 is at its lower limit 1220 for 27 % of it")
    >>> again = Finding("motor-at-lower", Light.AMBER, "C3 is at its lower limit for 27 % of it")
    >>> other = Finding("motor-at-lower", Light.AMBER, "C4 is at its lower limit for 22 % of it")
    >>> unsaid([again, other], [known]) == [other]
    True
    """
    known = list(others)
    codes = {each.code for each in known}
    return [
        each for each in findings
        if each.code not in codes
        and not any(one.message.startswith(each.message.partition(" for ")[0]) for one in known)
    ]  # fmt: skip


def said_once(findings: Iterable[Finding]) -> list[Finding]:
    """Findings of one list for a reader: what is said of several names in one line, actions once.

    Names stand before a colon, as ``"roll: …"``; an action that several share stays with the first.

    Example
    -------
    >>> two = [Finding("a", Light.AMBER, f"{axis}: short", "fly") for axis in ("roll", "yaw")]
    >>> for each in said_once([*two, Finding("b", Light.AMBER, "calm", "fly")]):
    ...     print(each)
    [amber] roll, yaw: short — fly
    [amber] calm
    """
    groups: dict[tuple[Light, str, str], list[tuple[str, Finding]]] = {}
    for each in findings:
        name, colon, said = each.message.partition(": ")
        key = (each.light, said if colon else each.message, each.action)
        groups.setdefault(key, []).append((name if colon else "", each))
    made, given = [], set[str]()
    for (_, said, action), members in groups.items():
        names = ", ".join(dict.fromkeys(name for name, _ in members if name))
        first = members[0][1]
        message = f"{names}: {said}" if len(members) > 1 and names else first.message
        made.append(replace(first, message=message, action="" if action in given else action))
        given.add(action)
    return made


def counted(number: int, noun: str) -> str:
    """A number with its noun.

    Example
    -------
    >>> counted(1, "gap"), counted(2, "gap")
    ('1 gap', '2 gaps')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


EXACT = 1e-9
"""Relative error of a computed number that stands for a rounder one, as 0.57 times 100 does."""


def at_least(value: float, decimals: int = 0) -> str:
    """A promised lower bound, rounded down: what is written is kept wherever the number is.

    Example
    -------
    >>> at_least(45.6), at_least(45.0), at_least(99.97, 1), at_least(100.0 * 0.57)
    ('45', '45', '99.9', '57')
    """
    scaled = value * 10.0**decimals
    return f"{math.floor(scaled + EXACT * abs(scaled)) / 10.0**decimals:.{decimals}f}"


def held(value: float | None, digits: int = 3, *, least: bool = True) -> float | None:
    """A promised bound at so many significant digits, rounded to the side on which it still holds.

    Parameters
    ----------
    value : float or None
        None stays None.
    digits : int
    least : bool
        Whether the number is at least so much, not at most.

    Example
    -------
    >>> held(45.46), held(45.4), held(1.6412, least=False), held(-0.1234), held(0.0)
    (45.4, 45.4, 1.65, -0.124, 0.0)
    """
    if not value or not math.isfinite(value):
        return value
    scale = 10.0 ** (digits - 1 - math.floor(math.log10(abs(value))))
    scaled, near = value * scale, EXACT * abs(value * scale)
    return (math.floor(scaled + near) if least else math.ceil(scaled - near)) / scale


SHOWN_DIGITS, MOST_DIGITS = 3, 9
"""Of a promised number: usually, and where fewer would tell it on the other side of its limit."""


def digits_apart(
    value: float, limit: float, *, least: bool, of_limit: int = 4, promised: bool = True
) -> int:
    """Fewest significant digits at which a number and its limit stand as they do, 3 to 9.

    Parameters
    ----------
    value, limit : float
        The number, and what is asked of it.
    least : bool
        Whether the number is to be at least so much as the limit, not at most.
    of_limit : int
        Fewest digits of the limit, which is rounded to the nearest.
    promised : bool
        Whether the number is rounded as `held` does, not to the nearest.

    Example
    -------
    >>> digits_apart(18.79, 18.83, least=False), digits_apart(18.8305, 18.8316, least=False)
    (3, 5)
    >>> digits_apart(44.9996, 45.0, least=True)
    3
    >>> digits_apart(44.9996, 45.0, least=True, promised=False)
    6
    """
    for count in range(SHOWN_DIGITS, MOST_DIGITS):
        near = float(f"{value:.{count}g}")
        shown = held(value, count, least=least) if promised else near
        told = float(f"{limit:.{max(count, of_limit)}g}")
        if shown is None or _meets(shown, told, least) == _meets(value, limit, least):
            return count
    return MOST_DIGITS


def told_apart(value: float, *limits: float, decimals: int = 0) -> str:
    """A number in words that has limits beside it: as many decimals as tell it from each.

    Parameters
    ----------
    value : float
    limits : float
        As they are printed, all their digits.
    decimals : int
        Fewest.

    Example
    -------
    >>> told_apart(10.3, 10.0), told_apart(34.2, 10.0), told_apart(0.2503, 0.25, decimals=3)
    ('10.3', '34', '0.2503')
    """
    for count in range(decimals, MOST_DIGITS):
        told = f"{value:.{count}f}"
        if all((float(told) > each) == (value > each) for each in limits):
            return told
    return f"{value:.{MOST_DIGITS}f}"


def _meets(value: float, limit: float, least: bool) -> bool:
    return value >= limit if least else value <= limit


MOST_DECIMALS, LONGEST = 12, 1e6
"""Of a number with its ends; from so much on the rounder form of a number is read more easily."""


def ranged(value: float, ends: tuple[float, float] | None) -> str:
    """A number with its ends, all to one decimal: three digits of the largest, or two of the width.

    Parameters
    ----------
    value : float
    ends : tuple of float or None
        None, or two that are alike: the number alone.

    Example
    -------
    >>> ranged(1.2, (1.15, 1.25)), ranged(101.26, (101.21, 101.31)), ranged(1.2, None)
    ('1.20 (1.15 to 1.25)', '101.26 (101.21 to 101.31)', '1.2')
    """
    if ends is None or not abs(ends[1] - ends[0]) > 0.0:
        return f"{value:.{SHOWN_DIGITS}g}"
    if not all(map(math.isfinite, ends)):
        low, high = (f"{each:.{SHOWN_DIGITS}g}" for each in ends)
        return f"{value:.{SHOWN_DIGITS}g} ({low} to {high})"
    largest = max(map(abs, (value, *ends)))
    usual = SHOWN_DIGITS - 1 - math.floor(math.log10(largest))
    needed = 1 - math.floor(math.log10(abs(ends[1] - ends[0])))
    places = min(MOST_DECIMALS, max(usual, needed))

    def told(each: float) -> str:
        if each == 0.0:
            return "0"
        rough = f"{each:.{SHOWN_DIGITS}g}" if largest >= LONGEST else f"{round(each, places):.0f}"
        return f"{each:.{places}f}" if places > 0 else rough

    return f"{told(value)} ({told(ends[0])} to {told(ends[1])})"
