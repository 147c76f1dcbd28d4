"""A coupled roll and yaw model with derivatives that are not there, and its noisy responses."""

from __future__ import annotations

import numpy as np

import flightid as fid

NOISE = 0.03
OMEGA = np.geomspace(0.3, 20.0, 40)
REAL = {"Lp": -3.0, "Lr": 0.8, "La": 25.0, "Nr": -0.9, "Np": -0.4, "Nd": -6.0, "Na": 1.1}
ABSENT = ("Ld", "Lz", "Nz")


def lateral() -> fid.StateSpaceModel:
    """Roll and yaw with three derivatives too many; Lz and Nz act through a lag that is there."""
    units = {"Ld": "rad/s^2", "La": "rad/s^2", "Nd": "rad/s^2", "Na": "rad/s^2", "Lz": "1/s^2"}
    values = {**REAL, "Ld": 0.0, "Lz": 0.0, "Nz": 0.0}
    parameters = [
        fid.Parameter(name, value, units.get(name, "1/s^2" if name == "Nz" else "1/s"))
        for name, value in values.items()
    ]
    parameters.append(fid.Parameter("T", 0.1, "s", minimum=0.02, maximum=1.0))
    return fid.StateSpaceModel(
        states={"p": "rad/s", "r": "rad/s", "z": "rad"},
        input_units={"a": "1", "d": "1"},
        measurements={"p": fid.Output("p", "rad/s"), "r": fid.Output("r", "rad/s")},
        equations={
            "p'": "Lp*p + Lr*r + La*a + Ld*d + Lz*z",
            "r'": "Np*p + Nr*r + Na*a + Nd*d + Nz*z",
            "T*z'": "-z + T*p",
        },
        parameters=fid.Parameters(parameters),
        name="roll and yaw",
    )


def measured(seed: int = 0, noise: float = NOISE) -> fid.FrequencyResponse:
    model = lateral()
    curve = model.frequency_response(OMEGA)
    random = np.random.default_rng(seed)
    errors = random.standard_normal((2, *curve.shape)) * noise
    return fid.FrequencyResponse.from_values(
        OMEGA,
        curve * np.exp(errors[0] + 1j * errors[1]),
        inputs=["a", "d"],
        outputs=["p", "r"],
        units={"p": "rad/s", "r": "rad/s", "a": "1", "d": "1"},
        random_error=np.full(curve.shape, noise),
    )
