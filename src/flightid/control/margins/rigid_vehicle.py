"""A user's word that nothing on a vehicle swings or bends where its model was not shown to hold."""

from __future__ import annotations

from collections.abc import Iterator

from flightid.conventions import Light
from flightid.findings import Finding

RIGID = "or declare rigid where nothing on the vehicle swings or bends there"
"""What stands in for a wider band where a light mode alone takes a promise."""
DECLARED = "rigid-declared"
"""Code of promises that rest on that word."""


def rigid_declared(rigid: bool, band_rad_s: tuple[float, float] | None) -> Iterator[Finding]:
    """That promises rest on this word, which is a part of them: no data show it.

    Parameters
    ----------
    rigid : bool
        Whether it was declared.
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s.

    Example
    -------
    >>> print(*rigid_declared(True, (1.2, 64.0)))
    [green] declared rigid: no light mode outside 1.2 to 64 rad/s is allowed for in these promises
    """
    if not rigid:
        return
    where = (
        "" if band_rad_s is None else f" outside {band_rad_s[0]:.3g} to {band_rad_s[1]:.3g} rad/s"
    )
    said = f"declared rigid: no light mode{where} is allowed for in these promises"
    yield Finding(DECLARED, Light.GREEN, said)
