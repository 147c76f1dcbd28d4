"""Units as a reader writes them, powers above the line; files and commands keep ``rad/s^2``."""

from __future__ import annotations

import re

POWER = re.compile(
    r"(?<![A-Za-z_0-9])(s|ms|min|h|m|ft|in|km|rad|deg|g|kg|slug|lb|N|V|A|W|Hz)\^([2-4])(?![0-9A-Za-z_.])"
)
RAISED = {"2": "²", "3": "³", "4": "⁴"}


def in_words(text: str) -> str:
    """A sentence, a heading or a unit with raised powers; names and formulas stay as they are.

    Example
    -------
    >>> in_words("K = 20 rad/s^2/V of x^2 and s^20"), in_words("kg m^2")
    ('K = 20 rad/s²/V of x^2 and s^20', 'kg m²')
    """
    if "^" not in text:
        return text
    return POWER.sub(lambda found: f"{found[1]}{RAISED[found[2]]}", text)
