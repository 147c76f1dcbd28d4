"""Options of a PID controller of its own; see `flightid.tune_controller`."""

from __future__ import annotations

from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.options import Options, option

STRUCTURES = {"p": "p", "pi": "pi", "pd": "pd", "pid": "pid", "pi_d": "pid", "i_pd": "pid",
              "two_dof": "pid"}  # fmt: skip
"""Gains that each structure has."""
WEIGHTS: dict[str, tuple[float | None, float]] = {
    "pi_d": (1.0, 0.0),
    "i_pd": (0.0, 0.0),
    "two_dof": (None, 0.0),
}
"""Set-point weights b and c of each structure; (1, 1) of the others, None is chosen."""


@dataclass(frozen=True)
class ControllerOptions(Options):
    """What a controller is made of, beside its requirements.

    Example
    -------
    >>> ControllerOptions(controller="pi", loop_rate_hz=50.0).gains
    'pi'
    """

    controller: str = option(
        "pi_d",
        choices=STRUCTURES,
        doc="Terms, and what acts on the set-point: pi_d differentiates the output alone, i_pd "
        "takes P from it too, two_dof chooses how much of the set-point P sees.",
    )
    loops: tuple[str, ...] = option(
        (), doc="Loops to close, each as output/input; default: those of models with one of each."
    )
    loop_rate_hz: float | None = option(
        None,
        unit="Hz",
        above=0.0,
        doc="Rate at which the controller runs; default: a sampled model's own, else continuous.",
    )
    filter_s: float | None = option(
        None,
        unit="s",
        minimum=0.0,
        doc="Time constant of the derivative's filter; default: a tenth of the time in which the "
        "plant turns.",
    )
    output_low: float | None = option(None, doc="Least output of the controller.")
    output_high: float | None = option(None, doc="Largest output of the controller.")
    output_rate_per_s: float | None = option(
        None, above=0.0, doc="Largest change of the output in a second."
    )
    overshoot: float = option(
        0.05, minimum=0.0, below=1.0,
        doc="Of two_dof: largest overshoot of a set-point step, of every plant drawn.",
    )  # fmt: skip
    measurement_noise: float | None = option(
        None, above=0.0, doc="Noise of the measured output, rms of white samples, its own unit."
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        low, high = self.output_low, self.output_high
        if low is not None and high is not None and low >= high:
            raise OptionError(
                "the limits of the output leave nothing between them",
                found=f"{low:g} to {high:g}",
                needed="output_low below output_high",
            )

    @property
    def gains(self) -> str:
        """Letters of the gains."""
        return STRUCTURES[self.controller]
