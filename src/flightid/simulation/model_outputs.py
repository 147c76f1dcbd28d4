"""A model's outputs on measured inputs, without noise (native side: `linear_simulation.rs`).

Modes that would grow over the record are followed from its end backwards, where they decay. What
comes out is a solution of the same equations, with the state of those modes given at the last
sample instead of the first, and it stays near its inputs however long the record is: the steady
response G(jω) of an unstable model is the transform of this two-sided response.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.models import GreyBoxModel, TransferFunctionModel
from flightid.models.linear.realisation import canonical_form
from flightid.simulation.finer_samples import finer_samples

Array = NDArray[np.float64]
HOLDS = ("band_limited", "first", "zero")
FINER = 4
"""Steps within a sample in which a band-limited input is followed."""
SLOW, FAST = 0.5, 7.0
"""Growth exponents over a record: below the first a mode is followed forwards, above the second
backwards, and between them the modes are parted where their rates lie furthest from each other."""


@dataclass(frozen=True)
class System:
    """State space of one response, or of all responses of a state-space model.

    Attributes
    ----------
    outputs, inputs : tuple of str
    matrices : tuple of ndarray
        A (n, n), B (n, m), C (p, n), D (p, m).
    delays_s : ndarray, shape (m,)
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    matrices: tuple[Array, ...]
    delays_s: Array


@dataclass(frozen=True)
class ModeSubset:
    """Those modes of a system that are followed in one direction of time.

    Attributes
    ----------
    matrices : tuple of ndarray
        A, B, C, D in the states of the subset.
    delays_s : ndarray
    backwards : bool
    basis : ndarray, shape (n_states, n), or None
        From these states to the system's; None where they are the same.
    """

    matrices: tuple[Array, ...]
    delays_s: Array
    backwards: bool
    basis: Array | None = None

    def turned(self, other: Array) -> ModeSubset:
        """The same modes in states whose basis is as near as may be to another one."""
        if self.basis is None or not self.basis.size:
            return self
        turn = np.linalg.lstsq(self.basis, other, rcond=None)[0]
        back = np.linalg.inv(turn)
        a, b, c, d = self.matrices
        turned = back @ a @ turn, back @ b, c @ turn, d
        return ModeSubset(turned, self.delays_s, self.backwards, self.basis @ turn)


def systems_of(model: GreyBoxModel) -> list[System]:
    """State spaces of a model: one of a state-space model, one for each response of the others.

    Responses of a transfer-function model may each have a delay of their own.

    Raises
    ------
    ModelError
        More zeros than poles, or a negative delay.
    SingularError
        The equations do not give every state derivative.
    """
    if not isinstance(model, TransferFunctionModel):
        a, b, c, d, delays = model.state_space()
        return [System(model.outputs, model.inputs, (a, b, c, d), delays)]
    systems = []
    for response, (gain, above, below, delay) in zip(
        model.responses, model.factored().values(), strict=True
    ):
        if delay < 0.0:
            raise ModelError(
                "a negative delay cannot be simulated", found=f"{delay:g} s", needed="0 s or more"
            )
        matrices = canonical_form((1, 1), [(0, 0, gain, above, below)])
        systems.append(System((response.output,), (response.input,), matrices, np.array([delay])))
    return systems


def split_modes(
    system: System, duration_s: float, like: Sequence[ModeSubset] = ()
) -> list[ModeSubset]:
    """Part a system into modes that are followed forwards and modes followed backwards.

    Parameters
    ----------
    system : System
    duration_s : float
        Length of the record, s.
    like : sequence of ModeSubset
        Of a system that is hardly another: modes are parted alike, in bases near its own, so that
        differences between both are small. An ordered Schur form turns its bases at will.

    Returns
    -------
    list of ModeSubset
        Their outputs add up to the system's.

    Reference
    ---------
    Golub & Van Loan, *Matrix Computations*, 4th ed., §7.6.3: block diagonalisation by an ordered
    Schur form and a Sylvester equation.
    """
    a, b, c, d = system.matrices
    rates = np.linalg.eigvals(a).real.astype(np.float64)
    parting = _parting(rates * duration_s, like)
    if parting is None:
        return [ModeSubset(system.matrices, system.delays_s, backwards=False)]
    parting /= duration_s
    triangle, turn, n = scipy.linalg.schur(a, output="real", sort=lambda re, _: re <= parting)
    cross = scipy.linalg.solve_sylvester(triangle[:n, :n], -triangle[n:, n:], -triangle[:n, n:])
    to_modes, from_modes = turn.T.copy(), turn.copy()
    to_modes[:n] -= cross @ turn.T[n:]
    from_modes[:, n:] += turn[:, :n] @ cross
    slow = (triangle[:n, :n], to_modes[:n] @ b, c @ from_modes[:, :n], d)
    fast = (triangle[n:, n:], to_modes[n:] @ b, c @ from_modes[:, n:], np.zeros_like(d))
    found = [
        ModeSubset(slow, system.delays_s, backwards=False, basis=from_modes[:, :n]),
        ModeSubset(fast, system.delays_s, backwards=True, basis=from_modes[:, n:]),
    ]
    bases = [each.basis for each in like]
    return [
        each if basis is None else each.turned(basis)
        for each, basis in zip(found, bases or [None, None], strict=True)
    ]


def _parting(growth: Array, like: Sequence[ModeSubset]) -> float | None:
    """Growth over a record at which modes are parted; None where all are followed forwards."""
    if like:
        if len(like) == 1:
            return None
        n = len(like[0].matrices[0])
        ordered = np.concatenate([[-np.inf], np.sort(growth), [np.inf]])
        return float(0.5 * (ordered[n] + ordered[n + 1]))
    if np.max(growth, initial=-np.inf) <= SLOW:
        return None
    between = np.sort(growth[(growth > SLOW) & (growth < FAST)])
    edges = np.concatenate([[SLOW], between, [FAST]])
    widest = int(np.argmax(np.diff(edges)))
    return float(0.5 * (edges[widest] + edges[widest + 1]))


def between_samples(values: Array, hold: str) -> Array:
    """Inputs as `driven_outputs` takes them: where band-limited, at finer steps.

    Parameters
    ----------
    values : ndarray, shape (m, n_samples)
        The measured inputs.
    hold : {"band_limited", "first", "zero"}
        What the inputs do between their samples.

    Returns
    -------
    ndarray, shape (m, n_samples) or (m, FINER (n_samples − 1) + 1)

    Reference
    ---------
    Unser, "Splines: a perfect fit for signal and image processing", *IEEE Signal Processing
    Magazine* 16 (1999): an interpolating spline tends to the band-limited interpolation.
    """
    if hold != "band_limited":
        return values
    dense = finer_samples(values, FINER)
    # Straight lines between points weaken ω by sinc²(ωT/2) = 1 − (ωT)²/12 + …: given back here.
    dense[:, 1:-1] -= np.diff(dense, 2, axis=1) / 12.0
    return dense


def driven_outputs(
    modes: list[ModeSubset], between: Array, sample_time_s: float, hold: str
) -> NDArray[np.float64]:
    """Outputs that the inputs drive, from rest at the end from which each mode is followed.

    Parameters
    ----------
    modes : list of ModeSubset
    between : ndarray, shape (..., m, n)
        The measured inputs from `between_samples`, of one record or of some of one length.
    sample_time_s : float
    hold : {"band_limited", "first", "zero"}
        What the inputs do between their samples.

    Returns
    -------
    ndarray, shape (..., p, n_samples)
    """
    how = (
        (sample_time_s, hold) if hold != "band_limited" else (sample_time_s / FINER, "first", FINER)
    )
    found = _driven(modes[0], between, *how)
    for each in modes[1:]:
        found += _driven(each, between, *how)
    return found


def free_outputs(modes: list[ModeSubset], n_samples: int, sample_time_s: float) -> Array:
    """What unknown states and unknown trims of the inputs add.

    Returns
    -------
    ndarray, shape (n_states + m, p, n_samples)
        States at the first sample, or at the last for modes that are followed backwards.
    """
    parts = [_free(each, n_samples, sample_time_s) for each in modes]
    if len(parts) == 1:
        return parts[0]
    sizes = [len(each.matrices[0]) for each in modes]
    steady = parts[0][sizes[0] :]
    for part, size in zip(parts[1:], sizes[1:], strict=True):
        steady += part[size:]
    return np.concatenate([*(part[:size] for part, size in zip(parts, sizes, strict=True)), steady])


def _free(modes: ModeSubset, n_samples: int, sample_time_s: float) -> Array:
    """Motion from each unit state and under each unit of a steady input, (n + m, p, n_samples).

    Outputs at sample k are C Eᵏ, E the transition of states and steady inputs together; each pass
    doubles how many samples are known.
    """
    a, b, c, d = modes.matrices
    n, m = b.shape
    system = np.zeros((n + m, n + m))
    system[:n] = np.hstack([a, b])
    ahead = -sample_time_s if modes.backwards else sample_time_s
    power = scipy.linalg.expm(ahead * system)
    known, needed = len(c), n_samples * len(c)
    rows = np.empty((needed, n + m))
    rows[:known] = np.hstack([c, d])
    with np.errstate(over="ignore", invalid="ignore"):  # who asks tells a run that explodes
        while known < needed:
            more = min(known, needed - known)
            np.matmul(rows[:more], power, out=rows[known : known + more])
            known, power = known + more, power @ power
    found = rows.reshape(n_samples, len(c), n + m).transpose(2, 1, 0)
    return np.ascontiguousarray(found[:, :, ::-1] if modes.backwards else found)


def _driven(
    modes: ModeSubset, values: Array, sample_time_s: float, hold: str, every: int = 1
) -> Array:
    """Outputs at every so many samples, from rest where the run begins."""
    first = hold == "first"
    if not modes.backwards:
        return _run(modes, values, modes.delays_s, sample_time_s, first=first, every=every)
    # From the end a delay is a lead. The run starts so long after the record, whose last samples
    # last on, that what is left of the lead is a delay again; it starts from a free state anyway.
    extra = int(np.ceil(np.max(modes.delays_s, initial=0.0) / sample_time_s - 1e-9))
    rest = np.maximum(extra * sample_time_s - modes.delays_s, 0.0)
    still = [(0, 0)] * (values.ndim - 1)
    turned = np.pad(values[..., ::-1], (*still, (0, extra + 1)), mode="edge")
    # A step held after its sample is held before it when time runs backwards.
    turned = turned[..., :-1] if first else turned[..., 1:]
    found = _run(modes, turned, rest, sample_time_s, first=first)
    return np.asarray(found[..., extra:][..., ::-1][..., ::every])


def _run(
    modes: ModeSubset,
    values: Array,
    delays_s: Array,
    sample_time_s: float,
    *,
    first: bool,
    every: int = 1,
) -> Array:
    sign = -1.0 if modes.backwards else 1.0
    a, b, c, d = (np.ascontiguousarray(each, dtype=np.float64) for each in modes.matrices)
    driven = np.ascontiguousarray(values, dtype=np.float64)
    late, at_rest = np.ascontiguousarray(delays_s), np.zeros(len(a))
    runs = driven.reshape(-1, *driven.shape[-2:])
    found = _native.linear_outputs(
        sign * a, sign * b, c, d, late, runs, at_rest, sample_time_s, first, every
    )
    return found.reshape(*driven.shape[:-2], *found.shape[1:])
