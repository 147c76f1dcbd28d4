"""One record of a time-domain fit: measured, modelled, and what belongs to the record alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.record import Record
from flightid.uncertainty.estimate import Estimate


@dataclass(frozen=True, repr=False, eq=False)
class FittedRecord:
    """A record with the fitted model beside it.

    Attributes
    ----------
    measured : Record
        What the fit saw.
    modelled : Record
        The model's inputs and its outputs with biases, on the record's time base; of a black box
        its free run.
    outputs : tuple of str
        Channels that were fitted.
    initial_state, bias, reference_shift : mapping of str to Estimate
        By state, output and input: what was estimated or held in this record. A bias is added to
        the model's output, a reference shift to its input.
    constants : mapping of str to Estimate
        By parameter that each record has for itself (`record_parameters`).
    states : mapping of str to ndarray, shape (n_samples,)
        Filter error: states predicted one sample ahead; empty for other methods.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> time_s = np.arange(300) * 0.02
    >>> record = fid.Record.from_arrays(time_s, inputs={"tau_phi": np.sign(np.sin(3 * time_s))})
    >>> model = fid.load_model("rate_first_order")
    >>> flown = fid.simulate(model, record, units={"p": "rad/s"})
    >>> flown = flown.replace({"p": flown["p"] + 0.1 * (-1.0) ** np.arange(300)})
    >>> fid.identify(model, flown).records[0]
    FittedRecord('record', 300 samples, outputs [p], rms of residuals p 0.1)
    """

    measured: Record
    modelled: Record
    outputs: tuple[str, ...]
    initial_state: Mapping[str, Estimate] = field(default_factory=dict)
    bias: Mapping[str, Estimate] = field(default_factory=dict)
    reference_shift: Mapping[str, Estimate] = field(default_factory=dict)
    states: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    constants: Mapping[str, Estimate] = field(default_factory=dict)

    def residual(self, name: str) -> NDArray[np.float64]:
        """Measured minus model of one output, shape (n_samples,)."""
        return np.asarray(self.measured[name] - self.modelled[name])

    @property
    def residuals(self) -> NDArray[np.float64]:
        """Measured minus model, shape (n_outputs, n_samples)."""
        return np.array([self.residual(name) for name in self.outputs])

    @property
    def rms(self) -> dict[str, float]:
        """Root mean square of the residual by output, in its unit."""
        return {name: float(np.sqrt(np.mean(self.residual(name) ** 2))) for name in self.outputs}

    def residual_record(self) -> Record:
        """The record with measured minus model in place of the outputs."""
        return self.measured.replace({name: self.residual(name) for name in self.outputs})

    def __repr__(self) -> str:
        """Size and rms of the residuals on one line."""
        shown = ", ".join(f"{name} {value:.3g}" for name, value in self.rms.items())
        return (
            f"FittedRecord({self.measured.name!r}, {self.measured.n_samples} samples, "
            f"outputs [{', '.join(self.outputs)}], rms of residuals {shown})"
        )

    def to_dict(self) -> dict[str, object]:
        """Plain values without the time histories."""
        parts = {
            "initial_state": self.initial_state,
            "bias": self.bias,
            "reference_shift": self.reference_shift,
            "constants": self.constants,
        }
        return {
            "name": self.measured.name,
            "n_samples": self.measured.n_samples,
            "rms": self.rms,
            **{
                key: {name: each.to_dict() for name, each in part.items()}
                for key, part in parts.items()
            },
        }
