"""NARX models: terms and weights that can be run (native: `narx_prediction.rs`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.models.estimated import EstimateProvenance
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.narx.scaling import Scaling
from flightid.models.narx.structure import NarxStructure
from flightid.models.narx.terms import Lag, Term
from flightid.models.parameters import Parameter
from flightid.models.sampled.coefficients import coefficients, replaced
from flightid.record import Record
from flightid.result import TableView
from flightid.table import Column, Table

SCHEMA = "flightid.narx_equation/1"
Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class NarxModel(TableView):
    """y(t) = Σ weight · term of lagged outputs and inputs, channels scaled.

    Attributes
    ----------
    structure : NarxStructure
        Lags, kernel and guard; its search settings say where the terms come from.
    terms : tuple of Term
    weights : tuple of float
        Of the terms of scaled channels.
    scaling : Scaling
        Of the training records.
    name : str
    estimated : EstimateProvenance or None
        What a fit knew of the parameters, where the model comes from its file.

    Example
    -------
    >>> from flightid.models import Lag
    >>> from flightid.models.narx.terms import product_term
    >>> scaling = Scaling({"y": 0.0, "u": 0.0}, {"y": 1.0, "u": 1.0}, {"y": "1", "u": "1"}, 0.1,
    ...                   (-1.0, 1.0))
    >>> NarxModel(NarxStructure(("u",), "y", 1, 1), (product_term([Lag("y", 1)]),), (0.5,), scaling)
    NarxModel('y' from u, 1 term, T 0.1 s)
    """

    structure: NarxStructure
    terms: tuple[Term, ...]
    weights: tuple[float, ...]
    scaling: Scaling
    name: str = "NARX model"
    estimated: EstimateProvenance | None = field(default=None, compare=False)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.structure.inputs

    @property
    def output(self) -> str:
        """Name of the output."""
        return self.structure.output

    @property
    def outputs(self) -> tuple[str, ...]:
        """The output, as a tuple of one name."""
        return (self.structure.output,)

    @property
    def units(self) -> Mapping[str, str]:
        """Unit by channel."""
        return self.scaling.units

    @property
    def sample_time_s(self) -> float:
        """Sample time, s."""
        return self.scaling.sample_time_s

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Weights by the names of their terms, of scaled channels."""
        names = [term.name for term in self.terms]
        return coefficients(names, self.weights, ("1",) * len(names))

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Copy with other values of some weights, by the names of their terms.

        Raises
        ------
        UnknownNameError
            There is no such one.
        """
        return replace(self, weights=tuple(replaced(self.parameters, values)), estimated=None)

    def linear_system(self) -> LinearSystem:
        """A NARX model has none.

        Raises
        ------
        ModelError
            Always.
        """
        raise ModelError(
            "a NARX model has no linear system",
            found="products or radial functions of lags, or lags without matrices",
            needed="a linear model",
            action="identify a PolynomialModel.arx of the same lags beside it",
        )

    def run(self, record: Record, horizon: int | str = "free_run") -> tuple[Array, int, int | None]:
        """Run one step, k steps or the whole record ahead; `flightid.predict` is for people.

        Parameters
        ----------
        record : Record
            With the model's channels, units and sample time; its first outputs start the lags.
        horizon : int or "free_run"

        Returns
        -------
        tuple of ndarray, int and int or None
            The output, shape (n_samples,), in its unit; samples at the start that are measured; the
            first sample at which the guard held the run.

        Raises
        ------
        DataError
            Another sample time, or fewer samples than lags.
        UnitError
            A channel in another unit.
        UnknownNameError
            A channel is missing.
        ModelError
            A term with a lag that the model does not have.
        """
        name, scaling = self.output, self.scaling
        scaled = [scaling.scaled(record, channel) for channel in (name, *self.inputs)]
        ahead = 0 if horizon == "free_run" else int(horizon)
        values, start, diverged = self.run_scaled(np.array(scaled[1:]), scaled[0], ahead)
        predicted = values * scaling.deviation[name] + scaling.mean[name]
        predicted[:start] = record[name][:start]
        return predicted, start, diverged

    def from_rest(self, inputs: Array, sample_time_s: float) -> Array:
        """Free run from lags at the training mean, shape (1, n_samples), in the output's unit.

        Parameters
        ----------
        inputs : ndarray, shape (n_inputs, n_samples)
            In the inputs' units.
        sample_time_s : float
            Of the inputs, s.

        Raises
        ------
        DataError
            Another sample time than in training.
        """
        scaling = self.scaling
        scaling.require_sample_time(sample_time_s)
        rows = [
            (row - scaling.mean[name]) / scaling.deviation[name]
            for name, row in zip(self.inputs, inputs, strict=True)
        ]
        values, _, _ = self.run_scaled(np.array(rows), np.zeros(inputs.shape[1]), 0)
        return np.asarray(values * scaling.deviation[self.output] + scaling.mean[self.output])[None]

    @property
    def memory(self) -> int:
        """Samples back that its longest lag looks."""
        return max(lag.lag for lag in self.structure.lags)

    def after(self, inputs: Array, outputs: Array) -> float:
        """The next output of a free run, in its unit.

        Parameters
        ----------
        inputs : ndarray, shape (n_inputs, memory + 1)
            The last ones and that of this instant, in the inputs' units.
        outputs : ndarray, shape (memory,)
            The last ones, the latest last, in the output's unit.
        """
        scaling, name = self.scaling, self.output
        past = (outputs - scaling.mean[name]) / scaling.deviation[name]
        moved = [
            (row - scaling.mean[channel]) / scaling.deviation[channel]
            for channel, row in zip(self.inputs, inputs, strict=True)
        ]
        values, _, _ = self.run_scaled(np.array(moved), np.append(past, 0.0), 0)
        return float(values[-1] * scaling.deviation[name] + scaling.mean[name])

    @property
    def guard(self) -> tuple[float, float]:
        """Range in which a run is held, in deviations of the output about its mean."""
        low, high = self.scaling.output_range
        middle, half = 0.5 * (low + high), 0.5 * self.structure.guard * (high - low)
        return middle - half, middle + half

    def run_scaled(
        self, inputs: Array, outputs: Array, horizon: int
    ) -> tuple[Array, int, int | None]:
        """Native run of scaled channels: values, samples that start it, where it was held.

        Parameters
        ----------
        inputs : ndarray, shape (n_inputs, n_samples)
        outputs : ndarray, shape (n_samples,)
            The one output.
        horizon : int
            Samples; 0: free run.
        """
        structure = self.structure
        channels = (structure.output, *structure.inputs)
        places = {lag: place for place, lag in enumerate(structure.lags)}
        radial = [i for i, term in enumerate(self.terms) if term.centre]
        centres = [self.terms[i].centre for i in radial]
        return _native.run_narx(
            outputs,
            inputs.reshape(len(structure.inputs), outputs.size),
            [(channels.index(lag.channel), lag.lag) for lag in structure.lags],
            self._monomials(places),
            np.array(centres, dtype=np.float64).reshape(len(radial), len(structure.lags)),
            np.array([self.weights[i] for i in radial], dtype=np.float64),
            structure.kernel or "gaussian",
            structure.beta,
            self.guard,
            horizon,
        )

    def _monomials(self, places: dict[Lag, int]) -> list[tuple[float, list[tuple[int, int]]]]:
        found = []
        for term, weight in zip(self.terms, self.weights, strict=True):
            if term.centre:
                continue
            missing = [str(lag) for lag, _ in term.factors if lag not in places]
            if missing:
                raise ModelError("a term has a lag outside the model", found=", ".join(missing))
            found.append((weight, [(places[lag], power) for lag, power in term.factors]))
        return found

    def summary(self) -> Table:
        """Table of the terms with their weights."""
        columns = (Column("term"), Column("kind"), Column("degree"), Column("weight"))
        rows = tuple(
            (term.name, term.kind, term.degree, weight)
            for term, weight in zip(self.terms, self.weights, strict=True)
        )
        notes = (
            repr(self.structure),
            "weights are of channels in deviations about the mean",
        )
        return Table(repr(self), columns, rows, notes)

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key, which `from_dict` and TOML files take back."""
        structure = {**asdict(self.structure), "inputs": list(self.inputs)}
        structure["kernel"] = structure["kernel"] or "none"
        return {
            "schema": SCHEMA,
            "kind": "narx",
            "name": self.name,
            "structure": structure,
            "terms": [
                {
                    "name": term.name,
                    "weight": float(weight),
                    "factors": [[lag.channel, lag.lag, power] for lag, power in term.factors],
                    "centre": [float(value) for value in term.centre],
                }
                for term, weight in zip(self.terms, self.weights, strict=True)
            ],
            "scaling": self.scaling.to_dict(),
            "units": dict(self.units),
        }

    def __repr__(self) -> str:
        """Channels, size and sample time on one line."""
        terms = f"{len(self.terms)} term{'' if len(self.terms) == 1 else 's'}"
        channels = f"{self.output!r} from {', '.join(self.inputs)}"
        return f"NarxModel({channels}, {terms}, T {self.sample_time_s:.4g} s)"
