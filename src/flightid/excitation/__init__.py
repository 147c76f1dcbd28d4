"""Excitation: inputs designed for identification, judged before they are flown.

>>> from flightid import excitation
>>> excitation.doublet(amplitude=0.1, step_s=0.5, sample_rate_hz=50.0)
Excitation('doublet', 1 input, 350 samples, 50 Hz, 7 s, relative peak factor 1.87)
"""

from flightid.excitation.assess import assess, window_lengths
from flightid.excitation.design import plan
from flightid.excitation.excitation import Excitation
from flightid.excitation.export import write_csv
from flightid.excitation.multisine import deal_harmonics, multisine
from flightid.excitation.multistep import (
    doublet,
    modified_3211,
    multistep,
    multistep_band,
    multistep_energy,
)
from flightid.excitation.noise import noise, uniform_noise
from flightid.excitation.plan import AxisForecast, Limits, Plan
from flightid.excitation.prbs import held_density, prbs
from flightid.excitation.spectrum import Spectrum
from flightid.excitation.sweep import ardupilot_chirp, sweep
from flightid.excitation.vehicle import RateAxis

__all__ = [
    "AxisForecast",
    "Excitation",
    "Limits",
    "Plan",
    "RateAxis",
    "Spectrum",
    "ardupilot_chirp",
    "assess",
    "deal_harmonics",
    "doublet",
    "held_density",
    "modified_3211",
    "multisine",
    "multistep",
    "multistep_band",
    "multistep_energy",
    "noise",
    "plan",
    "prbs",
    "sweep",
    "uniform_noise",
    "window_lengths",
    "write_csv",
]


def __dir__() -> list[str]:
    return sorted(__all__)
