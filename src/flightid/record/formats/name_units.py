"""Units at the end of a column's name, ``u_mps``: only those that can stand for nothing else.

Left out on purpose: one letter (``h_m``, ``tau_s``, ``bat_V``: measured, symmetric, velocity),
``ms`` beside a speed, ``rads`` and ``degs`` (angles or rates), ``rps`` (turns or radians), ``psi``
(an angle), ``g`` (gravity or grams), ``kt`` (a motor's constant), ``amp`` (amplitude).
"""

from __future__ import annotations

import re

WORDS = {
    "mps": "m/s", "mps2": "m/s^2", "mpss": "m/s^2", "m_s": "m/s", "m_s2": "m/s^2",
    "fps": "ft/s", "fps2": "ft/s^2", "ft_s": "ft/s", "ft_s2": "ft/s^2",
    "kmh": "km/h", "kph": "km/h", "kts": "kt", "knot": "kt", "knots": "kt",
    "deg": "deg", "degree": "deg", "degrees": "deg", "dps": "deg/s", "degps": "deg/s",
    "deg_s": "deg/s", "dps2": "deg/s^2", "deg_s2": "deg/s^2",
    "rad": "rad", "radian": "rad", "radians": "rad", "radps": "rad/s", "rad_s": "rad/s",
    "radps2": "rad/s^2", "rad_s2": "rad/s^2", "rpm": "rpm", "hz": "Hz", "ft": "ft", "feet": "ft",
    "mm": "mm", "cm": "cm", "km": "km", "metre": "m", "metres": "m", "meter": "m", "meters": "m",
    "kg": "kg", "lbf": "lbf", "newton": "N", "newtons": "N", "volt": "V", "volts": "V",
    "amps": "A", "ampere": "A", "amperes": "A", "pct": "%", "percent": "%", "us": "us",
    "degc": "degC",
}  # fmt: skip
"""In letters of either case."""
SPELLED = {"Nm": "N*m", "mV": "mV", "mA": "mA", "Pa": "Pa", "hPa": "hPa", "kPa": "kPa"}
"""In these letters alone: nm is a length, MA a current."""
LONGEST = 3
"""Words of a unit: m_per_s2."""
GAP = re.compile(r"[_ ]+")


def unit_at_end(name: str) -> str | None:
    """Unit that the last words of a column's name stand for; None where that is not certain.

    Example
    -------
    >>> unit_at_end("u_mps"), unit_at_end("q_deg_s"), unit_at_end("az_m_per_s2")
    ('m/s', 'deg/s', 'm/s^2')
    >>> unit_at_end("T_m"), unit_at_end("v_ms"), unit_at_end("deg"), unit_at_end("tau_psi")
    (None, None, None, None)
    """
    parts = GAP.split(name.strip(" _"))
    for count in range(min(LONGEST, len(parts) - 1), 0, -1):
        word = "_".join(parts[-count:]).replace("_per_", "_").replace("_sec", "_s")
        unit = SPELLED.get(word) or WORDS.get(word.lower())
        if unit is not None:
            return unit
    return None
