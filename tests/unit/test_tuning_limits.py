"""Requirements of tuning as a list: each says the number that it compares with."""

from __future__ import annotations

import re

import numpy as np
import pytest

from flightid.control.tuning.limits import ANGLE, WHOLE, limits, noise_limit
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.shortfalls import NAMES
from flightid.findings import held

RATE = "rate loop"
LOOPS = (RATE, WHOLE, ANGLE)
ASKED = TuningRequirements(
    phase_margin_deg=41.0,
    gain_margin_db=7.0,
    sensitivity_peak=1.7,
    delay_margin_s=0.013,
    crossover_rad_s=11.0,
    disturbance_bandwidth_rad_s=5.0,
    angle_phase_margin_deg=57.0,
    angle_crossover_rad_s=3.0,
)


def test_the_limit_in_words_is_the_limit_in_figures() -> None:
    made = limits(ASKED, LOOPS, 19.0)
    for limit in made:
        sign, number = re.fullmatch(r"([≥≤]) ([\d.]+)", limit.text).groups()
        inside = 1.001 if sign == "≥" else 0.999
        at = np.array([float(number) * inside, float(number) / inside])
        met, missed = limit.slack(at)
        assert met > 0.0 > missed, limit.name
        assert limit.name.startswith(f"{limit.loop}: {NAMES[limit.field]}")
    assert len({limit.name for limit in made}) == len(made)


@pytest.mark.parametrize("value", [18.83162, 18.831599, 18.825, 18.84, 18.7999999, 3.0, 1e9])
def test_a_number_is_shown_on_the_side_of_its_limit_that_it_is_on(value: float) -> None:
    """18.9 stood beside ≤ 18.83 and had passed: 18.826, rounded to the worse."""
    most = noise_limit(18.8316)
    digits = most.digits_beside(value)
    shown, limit = held(value, digits, least=False), float(most.told(digits).split()[1])
    assert shown is not None
    assert (shown <= limit) == (value <= most.bound)
    assert digits == 3 or not (held(value, 3, least=False) or 0.0) <= 18.83
    near = most.digits_beside(value, promised=False)
    assert (float(f"{value:.{near}g}") <= most.shown(near)) == (value <= most.bound)


def test_every_requirement_on_a_loop_is_a_limit() -> None:
    texts = {limit.text[2:] for limit in limits(ASKED, LOOPS, 19.0)}
    assert texts == {"41", "7", "1.7", "0.013", "11", "5", "57", "3", "19"}
    found = {(limit.loop, limit.field): limit.bound for limit in limits(ASKED, LOOPS, None)}
    margins = {"gain_margin_db": 7.0, "gain_reduction_margin_db": 7.0, "sensitivity_peak": 1.7}
    inner = margins | {"phase_margin_deg": 41.0, "delay_margin_s": 0.013}
    targets = {"crossover_rad_s": 11.0, "disturbance_bandwidth_rad_s": 5.0}
    wanted = {
        RATE: inner | targets,
        WHOLE: inner,
        # What delays the whole loop is asked of it there.
        ANGLE: margins | {"phase_margin_deg": 57.0, "crossover_rad_s": 3.0},
    }
    assert found == {(loop, k): v for loop, of in wanted.items() for k, v in of.items()}


def test_loops_that_are_not_there_have_no_limits() -> None:
    made = limits(ASKED, (RATE,), None)
    assert {limit.loop for limit in made} == {RATE}
    assert not [limit.name for limit in made if "identified band" in limit.name]
