"""Bands in which single responses of a model were shown to hold, and what they cover together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

Band = tuple[float, float]


def responses_about(bands: Mapping[str, Band], names: Iterable[str]) -> dict[str, Band]:
    """Those of ``"output/input"`` or, where all inputs were seen together, of their output.

    Parameters
    ----------
    bands : mapping of str to (float, float)
        By response, rad/s.
    names : iterable of str
        ``"output/input"``.

    Example
    -------
    >>> responses_about({"q/lon": (1.0, 12.0), "u/lon": (0.4, 2.0)}, ["q/lon", "theta/lon"])
    {'q/lon': (1.0, 12.0)}
    >>> responses_about({"q": (1.0, 12.0)}, ["q/lon"])
    {'q': (1.0, 12.0)}
    """
    found: dict[str, Band] = {}
    for name in names:
        for known in (name, name.partition("/")[0]):
            if known in bands:
                found[known] = bands[known]
                break
    return found


def covered_band(bands: Iterable[Band]) -> Band | None:
    """Widest band, as a ratio, that is covered without a gap; None of no bands.

    A loop that closes several responses, or a model that is read at any of its modes, is known
    where one of them showed it: slow ones below, fast ones above.

    Example
    -------
    >>> covered_band([(0.5, 2.0), (1.0, 12.0), (20.0, 30.0)])
    (0.5, 12.0)
    """
    runs: list[Band] = []
    for low, high in sorted(bands):
        if runs and low <= runs[-1][1]:
            runs[-1] = (runs[-1][0], max(runs[-1][1], high))
        else:
            runs.append((low, high))
    return max(runs, key=lambda run: run[1] / run[0]) if runs else None


def shown_words(bands: Mapping[str, Band], narrowest: Band) -> str:
    """Where a model was shown to hold: its responses together, and which of them ends first.

    Parameters
    ----------
    bands : mapping of str to (float, float)
        By response, rad/s; may be empty.
    narrowest : (float, float)
        rad/s.

    Example
    -------
    >>> shown_words({"q/lon": (1.0, 12.0), "u/lon": (0.4, 2.0)}, (0.4, 2.0))
    'its responses hold from 0.4 to 12 rad/s together, u/lon up to 2 rad/s'
    >>> shown_words({}, (0.4, 2.0))
    'it holds from 0.4 to 2 rad/s'
    """
    together = covered_band(bands.values())
    if together is None or len(set(bands.values())) < 2:
        return f"it holds from {narrowest[0]:.3g} to {narrowest[1]:.3g} rad/s"
    said = f"its responses hold from {together[0]:.3g} to {together[1]:.3g} rad/s together"
    first = min(bands, key=lambda name: bands[name][1])
    if bands[first][1] < together[1]:
        said += f", {first} up to {bands[first][1]:.3g} rad/s"
    return said
