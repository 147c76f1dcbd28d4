"""The polynomials of a linear sampled model as numbers: roots, gains, responses, state space."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.models.estimated import EstimateProvenance
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.parameters import Parameter
from flightid.models.polynomial.structure import AUTO, COMMON, SEPARATE, PolynomialStructure
from flightid.models.sampled.channel_order import require_inputs_first
from flightid.models.sampled.coefficients import coefficients, replaced_numbers
from flightid.models.sampled.discrete_modes import DiscreteMode, discrete_modes, polynomial_roots

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array, Array]


@dataclass(frozen=True, eq=False, repr=False)
class Polynomials:
    """Base of `PolynomialModel`, whose docstring says what its fields are."""

    inputs: tuple[str, ...]
    output: str
    sample_time_s: float
    a: ArrayLike = (1.0,)
    b: Sequence[ArrayLike] = ()
    c: ArrayLike = (1.0,)
    d: ArrayLike = (1.0,)
    f: Sequence[ArrayLike] = ()
    nk: tuple[int, ...] = ()
    noise_variance: float | None = None
    covariance: Array | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    name: str = "polynomial model"
    operating_point: Mapping[str, float] = field(default_factory=dict)
    estimated: EstimateProvenance | None = field(default=None, compare=False)
    denominators: str = SEPARATE

    def __post_init__(self) -> None:
        require_inputs_first(self.inputs, self.output)
        inputs = tuple(self.inputs)
        object.__setattr__(self, "inputs", inputs)
        for letter in "acd":
            object.__setattr__(self, letter, _row(getattr(self, letter), letter, monic=True))
        given = {"b": self.b, "f": self.f or [(1.0,)] * len(inputs)}
        for letter, rows in given.items():
            made = tuple(_row(row, letter, monic=letter == "f") for row in rows)
            if len(made) != len(inputs):
                raise ModelError(
                    f"polynomials {letter} do not fit the inputs",
                    found=len(made),
                    needed=f"one for each of {len(inputs)} inputs",
                )
            object.__setattr__(self, letter, made)
        unlike = any(not np.array_equal(row, self.f[0]) for row in self.f)
        if self.denominators not in (COMMON, SEPARATE) or (self.denominators == COMMON and unlike):
            raise ModelError(
                "the denominators are not as they are said to be",
                found=f"{self.denominators!r}, F {'unlike' if unlike else 'alike'}",
                needed="'separate', or 'common' with the same F for all inputs",
            )
        object.__setattr__(self, "nk", tuple(self.nk) or (1,) * len(inputs))
        if not (math.isfinite(self.sample_time_s) and self.sample_time_s > 0):
            raise ModelError("the sample time is not positive", found=self.sample_time_s)
        if self.noise_variance is not None and not self.noise_variance >= 0:
            raise ModelError("the noise variance is negative", found=self.noise_variance)
        if self.covariance is not None and np.shape(self.covariance) != (len(self.theta),) * 2:
            raise ModelError(
                "the covariance does not fit the coefficients",
                found=np.shape(self.covariance),
                needed=(len(self.theta),) * 2,
            )

    @classmethod
    def from_theta(
        cls,
        structure: PolynomialStructure,
        theta: ArrayLike,
        sample_time_s: float,
        *,
        noise_variance: float | None = None,
        covariance: Array | None = None,
        units: Mapping[str, str] | None = None,
        name: str = "polynomial model",
        operating_point: Mapping[str, float] | None = None,
    ) -> Self:
        """Model from the coefficients of a structure, in the order of its `names`."""
        return cls(
            structure.inputs,
            structure.output,
            sample_time_s,
            **_rows(structure, theta),
            nk=structure.nk,
            noise_variance=noise_variance,
            covariance=covariance,
            units=units or {},
            name=name,
            operating_point=operating_point or {},
            denominators=COMMON if structure.is_common else SEPARATE,
        )

    @cached_property
    def structure(self) -> PolynomialStructure:
        """Orders of the model, with the default options of `identify`."""
        return PolynomialStructure(
            self.inputs,
            self.output,
            np.size(self.a) - 1,
            tuple(np.size(row) for row in self.b),
            np.size(self.c) - 1,
            np.size(self.d) - 1,
            tuple(np.size(row) - 1 for row in self.f),
            self.nk,
            denominators=self.denominators if self._is_choice else AUTO,
        )

    @property
    def _is_choice(self) -> bool:
        return len(self.inputs) > 1 and any(np.size(row) > 1 for row in self.f)

    @property
    def distinct_f(self) -> tuple[Array, ...]:
        """Each F once: of every input, or the one that they share."""
        rows = tuple(np.asarray(row) for row in self.f)
        return rows[:1] if self.denominators == COMMON and self._is_choice else rows

    @property
    def theta(self) -> Array:
        """Coefficients in the order of `names`, shape (n,)."""
        a, c, d = (np.asarray(row)[1:] for row in (self.a, self.c, self.d))
        tails = [row[1:] for row in self.distinct_f]
        return np.concatenate([a, *map(np.asarray, self.b), c, d, *tails])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients."""
        return self.structure.names

    def transfer(self, name: str) -> tuple[Array, Array]:
        """Numerator and denominator of output over input in powers of z⁻¹, the delay included."""
        i = self.inputs.index(name)
        numerator = np.concatenate([np.zeros(self.nk[i]), np.asarray(self.b[i])])
        return numerator, np.convolve(np.asarray(self.a), np.asarray(self.f[i]))

    @property
    def noise_transfer(self) -> tuple[Array, Array]:
        """Numerator C and denominator A D of output over e, in powers of z⁻¹."""
        return np.asarray(self.c), np.convolve(np.asarray(self.a), np.asarray(self.d))

    def poles(self) -> dict[str, NDArray[np.complex128]]:
        """Poles in the z plane by ``"output/input"``, without those of the delay."""
        return {f"{self.output}/{u}": polynomial_roots(self.transfer(u)[1]) for u in self.inputs}

    def zeros(self) -> dict[str, NDArray[np.complex128]]:
        """Zeros in the z plane by ``"output/input"``, without those at the origin."""
        return {f"{self.output}/{u}": polynomial_roots(self.transfer(u)[0]) for u in self.inputs}

    def modes(self) -> dict[str, tuple[DiscreteMode, ...]]:
        """Natural frequencies and dampings by ``"output/input"``, s = ln z / T."""
        return {name: discrete_modes(z, self.sample_time_s) for name, z in self.poles().items()}

    def gains(self) -> dict[str, float | None]:
        """Steady gain by ``"output/input"``; None for an integrator."""
        found: dict[str, float | None] = {}
        for name in self.inputs:
            above, below = self.transfer(name)
            rest = float(np.sum(below))
            found[f"{self.output}/{name}"] = float(np.sum(above)) / rest if rest else None
        return found

    def frequency_response(self, omega_rad_s: ArrayLike) -> NDArray[np.complex128]:
        """Response from the inputs, shape (1, n_inputs, n_freqs), at frequencies in rad/s."""
        omega = np.asarray(omega_rad_s, dtype=np.float64)
        later = np.exp(-1j * omega * self.sample_time_s)
        rows = []
        for name in self.inputs:
            above, below = self.transfer(name)
            rows.append(np.polyval(above[::-1], later) / np.polyval(below[::-1], later))
        return np.array(rows, dtype=np.complex128).reshape(1, len(self.inputs), omega.size)

    def state_space(self) -> Matrices:
        """Discrete innovations form A, B, C, D, K in observer form, not minimal in general.

        x(t+1) = A x + B u + K e, y = C x + D u + e.

        Reference: Ljung, *System Identification*, 2nd ed., section 4.3.
        """
        noise, common = self.noise_transfer
        filters = self.distinct_f
        for row in filters:
            common, noise = np.convolve(common, row), np.convolve(noise, row)
        above = []
        for i, name in enumerate(self.inputs):
            numerator = np.convolve(self.transfer(name)[0], np.asarray(self.d))
            for j, row in enumerate(filters):
                own = j == i or len(filters) < len(self.inputs)
                numerator = numerator if own else np.convolve(numerator, row)
            above.append(numerator)
        n = max(row.size for row in (*above, common, noise)) - 1
        full = [np.pad(row, (0, n + 1 - row.size)) for row in (common, noise, *above)]
        below, noise, *padded = full
        a = np.eye(n, k=1)
        a[:, 0] -= below[1:]
        direct = np.array([row[0] for row in padded])
        b = np.array([row[1:] - row[0] * below[1:] for row in padded]).reshape(-1, n).T
        c = np.eye(1, n)
        return a, b, c, direct[None], (noise[1:] - below[1:])[:, None]

    @property
    def outputs(self) -> tuple[str, ...]:
        """The output, as a tuple of one name."""
        return (self.output,)

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """The coefficients by name, with their units."""
        return coefficients(self.names, self.theta, self.coefficient_units)

    @property
    def coefficient_units(self) -> tuple[str, ...]:
        """Units in the order of `names`: B carries output over input, the rest are plain."""
        found = ["1"] * (np.size(self.a) - 1)
        above = self.units.get(self.output, "1")
        for name, row in zip(self.inputs, self.b, strict=True):
            below = self.units.get(name, "1")
            found += [above if below == "1" else f"{above}/({below})"] * np.size(row)
        return (*found, *["1"] * (len(self.theta) - len(found)))

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Copy with other values of some coefficients.

        Raises
        ------
        UnknownNameError
            There is no such one.
        """
        structure = self.structure
        numbers = replaced_numbers(dict(zip(structure.names, self.theta, strict=True)), values)
        return replace(self, **_rows(structure, numbers), estimated=None)

    def linear_system(self) -> LinearSystem:
        """The response to the inputs as a recursion; the noise model is left out."""
        # Poles of C/D alone are no poles of the vehicle, however near they come to cancel.
        plain = replace(self, c=np.ones(1), d=np.ones(1), covariance=None)
        return LinearSystem(
            *plain.state_space()[:4],
            self.inputs,
            self.outputs,
            sample_time_s=self.sample_time_s,
            units=self.units,
            name=self.name,
        )


def _rows(structure: PolynomialStructure, theta: ArrayLike) -> dict[str, Any]:
    """Polynomials by letter, of coefficients in the order of the structure's names."""
    parts = np.split(np.asarray(theta, dtype=np.float64), np.cumsum(structure.counts)[:-1])
    n, one = len(structure.inputs), np.ones(1)
    below = [np.concatenate([one, part]) for part in parts[n + 3 :]]
    return {
        "a": np.concatenate([one, parts[0]]),
        "b": parts[1 : n + 1],
        "c": np.concatenate([one, parts[n + 1]]),
        "d": np.concatenate([one, parts[n + 2]]),
        "f": below * n if structure.is_common else below,
    }


def _row(values: ArrayLike, letter: str, *, monic: bool) -> Array:
    row = np.array(values, dtype=np.float64)
    if row.ndim != 1 or not np.all(np.isfinite(row)):
        raise ModelError(f"polynomial {letter} is not a row of finite numbers", found=values)
    if monic and (row.size == 0 or row[0] != 1.0):
        raise ModelError(f"polynomial {letter} does not start with one", found=values)
    row.flags.writeable = False
    return row
