"""Options of the regression methods on records; see `flightid.identify`."""

from __future__ import annotations

from dataclasses import dataclass, fields

from flightid.errors import OptionError
from flightid.identification.records.options import HOLDS

Band = tuple[float, float]


@dataclass(frozen=True)
class RegressionOptions:
    """What all of them share."""

    hold: str = "first"
    maximum_iterations: int = 100

    def __post_init__(self) -> None:
        if self.hold not in HOLDS:
            raise OptionError("hold is not known", found=repr(self.hold), needed=" or ".join(HOLDS))
        if self.maximum_iterations < 1:
            raise OptionError(
                "maximum_iterations is too small", found=self.maximum_iterations, needed="1 or more"
            )

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        plain = {each.name: getattr(self, each.name) for each in fields(self)}
        return {name: list(v) if isinstance(v, tuple) else v for name, v in plain.items()}


@dataclass(frozen=True)
class EquationErrorOptions(RegressionOptions):
    """Options of equation error in the time domain."""

    half_width: int = 2
    output_bias: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.half_width < 1:
            raise OptionError(
                "half_width is too small", found=self.half_width, needed="1 neighbour or more"
            )


@dataclass(frozen=True)
class FourierOptions(RegressionOptions):
    """Options of equation error in the frequency domain."""

    band_rad_s: Band | None = None


@dataclass(frozen=True)
class FourierOutputErrorOptions(FourierOptions):
    """Options of output error in the frequency domain."""

    starts: int = 1
    seed: int = 0


@dataclass(frozen=True)
class FilterErrorOptions(RegressionOptions):
    """Options of filter error."""

    process_noise: tuple[str, ...] | list[str] | None = None
    output_bias: bool = True
    input_bias: bool = False
    starts: int = 1
    seed: int = 0
