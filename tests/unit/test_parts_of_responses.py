"""Records behind a response agree or not, in whatever units their parameters are."""

from __future__ import annotations

import numpy as np
from scipy.signal import chirp, lfilter

import flightid as fid
from tests.closeness import assert_close

STEP_S, SAMPLES = 0.02, 2000


def _flight(seed: int, effect: float) -> fid.Record:
    """A sweep of a slow roll axis, whose damping and effectiveness hang together."""
    random, time_s = np.random.default_rng(seed), np.arange(SAMPLES) * STEP_S
    swept = 0.2 * chirp(time_s, 0.2, time_s[-1], 5.0, method="logarithmic")
    decay = np.exp(-0.8 * STEP_S)
    rate = lfilter([0.0, effect * (1.0 - decay) / 0.8], [1.0, -decay], swept)
    return fid.Record.from_arrays(
        time_s,
        inputs={"da": swept},
        outputs={"p": rate + 0.02 * np.std(rate) * random.standard_normal(SAMPLES)},
        units={"p": "rad/s", "da": "1"},
        hold="zero",
    )


def _fit(flights: list[fid.Record], size: float) -> fid.Fit:
    model = fid.StateSpaceModel.from_dict(
        {
            "name": "roll",
            "states": {"p": "rad/s"},
            "inputs": {"da": "1"},
            "outputs": {"p": "p"},
            "delays": {"da": "tau"},
            "parameters": {
                "Lp": {"value": -0.8 / size, "unit": "1/s"},
                "Lda": {"value": 10.0 * size, "unit": "1/s^2"},
                "tau": {"value": 0.01, "unit": "s", "min": -0.1, "max": 0.1},
            },
            "equations": {"p'": f"{size!r}*Lp*p + {1.0 / size!r}*Lda*da"},
        }
    )
    response = fid.estimate_response(flights, inputs="da", outputs="p", n_omega=20)
    return fid.identify(model, response)


def test_units_of_parameters_change_no_word_of_records_that_differ() -> None:
    """A delay of 9 ms had an error of 0.57 s: what a record tells was asked in raw units."""
    flights = [_flight(1, 10.0), _flight(2, 10.5)]
    found = [_fit(flights, size) for size in (1.0, 1000.0)]
    one, other = (fit.agreement for fit in found)
    assert one is not None
    assert other is not None
    assert one.records is not None
    assert one.records < 0.1
    assert_close(other.records, one.records, rtol=1e-3, why="ends of two searches")
    assert one.by_scatter is not None
    assert other.by_scatter is not None
    units = [1e-3, 1e3, 1.0]
    assert_close(other.by_scatter, one.by_scatter * units, rtol=1e-2, why="ends of two searches")
