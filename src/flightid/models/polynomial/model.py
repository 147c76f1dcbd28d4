"""Linear polynomial models A y = Σ (B/F) u + (C/D) e (native side: `polynomial_predictor.rs`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

from flightid.models.polynomial.description import model_from_table, model_to_table
from flightid.models.polynomial.display import difference_equation, factored, polynomial_table
from flightid.models.polynomial.makers import StructureMakers
from flightid.models.polynomial.polynomials import Array, Polynomials
from flightid.models.polynomial.prediction import forced_run
from flightid.models.sampled.channels import gather_channels, hold_diverged, require_same
from flightid.record import Record
from flightid.result import TableView
from flightid.table import Table


class PolynomialModel(Polynomials, StructureMakers, TableView):
    """A(q) y(t) = Σ Bᵢ(q)/Fᵢ(q) uᵢ(t - nkᵢ) + C(q)/D(q) e(t), polynomials in q⁻¹.

    Channels are deviations from an operating point, in the channels' units.

    Attributes
    ----------
    inputs : tuple of str
    output : str
    sample_time_s : float
        Sample time T, s.
    a, c, d : ndarray
        Coefficients of A, C, D from the leading one on.
    b, f : tuple of ndarray
        For each input the coefficients of B from its delay on, and of F from the leading one on.
    nk : tuple of int
        Delay of each input, samples.
    noise_variance : float or None
        Of e, in the square of the output's unit.
    covariance : ndarray, shape (n, n), or None
        Of the coefficients in the order of `names`.
    units : mapping of str to str
        By channel; a channel left out is dimensionless.
    name : str
    operating_point : mapping of str to float
        Value of each channel about which the model holds, in its unit: where the training records
        were. A channel left out counts from zero.
    estimated : EstimateProvenance or None
        What a fit knew of the parameters, where the model comes from its file.
    denominators : {"separate", "common"}
        Whether each input has coefficients of F of its own, or all share those of one.

    Raises
    ------
    ModelError
        Polynomials that do not fit the inputs, do not start with one or are not finite; a sample
        time or variance that is not positive.

    Example
    -------
    >>> pitch = PolynomialModel(("voltage",), "theta", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])
    >>> pitch
    PolynomialModel(ARX, 'theta' from voltage, na 2, nb 2, nk 1, T 0.1 s)
    >>> print(pitch.difference_equation())
    theta(t) = 1.5 theta(t-1) - 0.7 theta(t-2) + 1 voltage(t-1) + 0.5 voltage(t-2) + e(t)
    """

    def simulate(self, record: Record) -> Array:
        """Free run from rest on the inputs as they are, shape (n_samples,), output's unit."""
        data = gather_channels([record], self.output, self.inputs, "none")
        require_same(self, data.units, data.sample_time_s)
        run = forced_run(self, data.inputs)
        hold_diverged(run[None])
        return run

    def difference_equation(self) -> str:
        """The model as an equation in samples, for ARX and ARMAX; else in polynomials."""
        return difference_equation(self)

    def factored(self) -> tuple[str, ...]:
        """Its transfer functions in factors of z."""
        return tuple(factored(self, name) for name in self.inputs)

    def summary(self) -> Table:
        """Table of poles and zeros with natural frequencies and dampings."""
        return polynomial_table(self)

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key, which `from_dict` and TOML files take back."""
        return model_to_table(self)

    @classmethod
    def from_dict(cls, content: Mapping[str, object]) -> Self:
        """Model from plain values such as a TOML file gives.

        Raises
        ------
        ModelError
            A key is missing, unknown or of the wrong type.
        """
        return cls(**model_from_table(content))

    def __repr__(self) -> str:
        """Kind, orders and sample time on one line."""
        text = repr(self.structure).removeprefix("PolynomialStructure(").removesuffix(")")
        return f"PolynomialModel({text}, T {self.sample_time_s:.4g} s)"
