"""A derivative that a record refutes: what `verify` says its inputs ask, in calm air and in gusts.

The vehicle is that of `gusts`. Of an exact model one derivative is off; a fit is of three flights,
and the vehicle that is verified differs in one derivative; a right model has none. A parameter
that is named counts by its interval, a right one that is named alone as a miss.
"""

from __future__ import annotations

import re
import time
from functools import partial

import flightid as fid
from flightid.conventions import Light
from flightid.validation.verification.parameter_findings import CODE
from tests.strangers.counting import Case, Reading, Trial
from tests.strangers.gusts import TRUTH, flight, model

FORM = re.compile(r"(\w+) = (\S+) \((\S+) to ([^)\s]+)\)")
ALIKE = re.compile(r"as another ([\w ]+) would")
TIME_S, DURATION_S = 1.0, 30.0


def verified(seed: int, *, gust_m_s: float, factor: float, fitted: bool = False) -> Trial:
    """One flight of a vehicle with a derivative off by a factor from what the model has."""
    begun = time.perf_counter()
    wrong = [*TRUTH][seed % len(TRUTH)]
    if fitted:
        source: object = _fit(seed, gust_m_s)
        vehicle = {**TRUTH, wrong: factor * TRUTH[wrong]}
    else:
        source, vehicle = model(1.0).with_values({wrong: TRUTH[wrong] / factor}), TRUTH
    record = flight(10 * seed + 3, gust_m_s, TIME_S, DURATION_S, vehicle)
    findings = fid.verify(source, record).findings
    light = max((each.light for each in findings), key=[*Light].index)
    said = next((each.message for each in findings if each.code == CODE), "")
    return Trial(_read(said, vehicle, wrong), str(light), time.perf_counter() - begun)


def _read(said: str, vehicle: dict[str, float], wrong: str) -> tuple[Reading, ...]:
    named, alike = FORM.search(said), ALIKE.search(said)
    if named is None:
        return ()
    name, *numbers = named.groups()
    if name != wrong and alike is not None and wrong in alike[1]:
        return ()
    value, low, high = map(float, numbers)
    return (Reading(name, vehicle[name], value, (high - low) / 3.92, (low, high)),)


def _fit(seed: int, gust_m_s: float) -> fid.Fit:
    records = [flight(10 * seed + k, gust_m_s, TIME_S, DURATION_S) for k in range(3)]
    method = "filter_error" if gust_m_s else "output_error"
    return fid.identify(model(1.0), records, method=method)


REFUTED = (
    *(
        Case(
            f"refuted, {'fit' if fitted else 'exact'}, gust {gust:g} m/s, {factor:g}",
            partial(verified, gust_m_s=gust, factor=factor, fitted=fitted),
        )
        for fitted in (False, True)
        for gust in (0.0, 0.5, 2.0)
        for factor in (1.0, 1.3)
    ),
)
LIGHTS = REFUTED
