"""Options of the regression methods on records; see `flightid.identify`."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.frozen import dataclass
from flightid.identification.records.options import HOLDS
from flightid.options import Options, option

Band = tuple[float, float]


@dataclass(frozen=True)
class RegressionOptions(Options):
    """What all of them share."""

    hold: str = option(
        "band_limited", choices=HOLDS, doc="What inputs do between samples, where no record knows."
    )
    maximum_iterations: int = option(100, minimum=1, doc="Most steps of each start.")


@dataclass(frozen=True)
class EquationErrorOptions(RegressionOptions):
    """Options of equation error in the time domain."""

    half_width: int = option(
        2, unit="samples", minimum=1, doc="Neighbours on each side of a local derivative."
    )
    output_bias: bool = option(
        True, doc="Constants added to each equation of each record, estimated."
    )


@dataclass(frozen=True)
class FourierOptions(RegressionOptions):
    """Options of equation error in the frequency domain."""

    band_rad_s: Band | None = option(
        None, unit="rad/s", doc="Band of the harmonics; default: to two fifths of Nyquist."
    )


@dataclass(frozen=True)
class FourierOutputErrorOptions(FourierOptions):
    """Options of output error in the frequency domain."""

    starts: int = option(1, minimum=1, doc="Number of starts, the model's values first.")
    seed: int = option(0, minimum=0, doc="Seed of the starts.")


@dataclass(frozen=True)
class FilterErrorOptions(RegressionOptions):
    """Options of filter error."""

    hold: str = option(
        "first", choices=HOLDS, doc="What inputs do between samples, where no record knows."
    )
    process_noise: Sequence[str] | None = option(
        None, doc="States driven by noise; default: those whose equations hold free parameters."
    )
    output_bias: bool = option(True, doc="Constants added to outputs of each record, estimated.")
    input_bias: bool = option(False, doc="Constants added to inputs of each record, estimated.")
    gust_states: bool = option(
        True,
        doc="Whether a gust with a memory is tried, and kept where it is likelier.",
    )
    starts: int = option(1, minimum=1, doc="Number of starts, the model's values first.")
    seed: int = option(0, minimum=0, doc="Seed of the starts.")
