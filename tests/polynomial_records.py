"""Records of known polynomial models, with and without noise."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

import flightid as fid

ARMAX = fid.PolynomialModel(
    ("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]], c=[1, -1.0, 0.2], units={"y": "rad"}
)
TWO_INPUTS = fid.PolynomialModel(
    ("u", "v"),
    "y",
    0.1,
    b=[[1.0, 0.5], [0.3, -0.2, 0.1]],
    c=[1, 0.5],
    d=[1, -0.8],
    f=[[1, -1.5, 0.7], [1, -0.6]],
    nk=(1, 3),
)


def flown(
    model: fid.PolynomialModel,
    seed: int,
    *,
    n: int = 400,
    noise: float = 0.0,
    offset: float = 0.0,
    warm_up: int = 300,
) -> fid.Record:
    """A record that starts in the middle of a run, so that its past is not at rest."""
    generator = np.random.default_rng(seed)
    inputs = {name: generator.standard_normal(n + warm_up) for name in model.inputs}
    output = lfilter(*model.noise_transfer, noise * generator.standard_normal(n + warm_up))
    for name, row in inputs.items():
        output = output + lfilter(*model.transfer(name), row)
    return fid.Record.from_arrays(
        np.arange(n) * model.sample_time_s,
        inputs={name: row[warm_up:] for name, row in inputs.items()},
        outputs={model.output: output[warm_up:] + offset},
        units=model.units,
    )
