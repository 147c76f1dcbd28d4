"""Conditioning: records made fit for estimation, each step kept in their history.

>>> import numpy as np
>>> from flightid import Record, conditioning
>>> time_s = np.arange(400) / 200
>>> raw = Record.from_arrays(time_s, outputs={"p": 1 + np.sin(time_s)}, units={"p": "rad/s"})
>>> ready = conditioning.resample(conditioning.detrend(raw), 0.01)
>>> [step.operation for step in ready.history]
['conditioning.detrend', 'conditioning.resample']
"""

from flightid.conditioning.align import Skew, align, estimate_skew
from flightid.conditioning.axes import convert_attitude, convert_axes, flip_sign
from flightid.conditioning.consistency import check_consistency
from flightid.conditioning.consistency_result import KinematicConsistency
from flightid.conditioning.detrend import Trend, detrend
from flightid.conditioning.filter import FilterDesign, filter_record
from flightid.conditioning.outliers import remove_outliers
from flightid.conditioning.resample import resample
from flightid.conditioning.segment import drop, split, split_by_mode
from flightid.conditioning.sensor_position import (
    accelerations_at_cg,
    air_data_at_cg,
    velocities_at_cg,
)
from flightid.conditioning.smoothing import (
    SmoothSignal,
    differentiate,
    fourier_smooth,
    local_derivative,
    local_mean,
)
from flightid.conventions import AxisConversion
from flightid.record import GapPolicy, Interpolation, StampPolicy, UniformBase, to_uniform

__all__ = [
    "AxisConversion",
    "FilterDesign",
    "GapPolicy",
    "Interpolation",
    "KinematicConsistency",
    "Skew",
    "SmoothSignal",
    "StampPolicy",
    "Trend",
    "UniformBase",
    "accelerations_at_cg",
    "air_data_at_cg",
    "align",
    "check_consistency",
    "convert_attitude",
    "convert_axes",
    "detrend",
    "differentiate",
    "drop",
    "estimate_skew",
    "filter_record",
    "flip_sign",
    "fourier_smooth",
    "local_derivative",
    "local_mean",
    "remove_outliers",
    "resample",
    "split",
    "split_by_mode",
    "to_uniform",
    "velocities_at_cg",
]


def __dir__() -> list[str]:
    return sorted(__all__)
