"""What a model leaves of the measured outputs, with unknown initial states and trims fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.identification.frequency_domain.unknown_motion import (
    FollowedRun,
    MotionBasis,
    MotionFitter,
)
from flightid.models import GreyBoxModel
from flightid.responses.errors.linear_estimate import LinearEstimate
from flightid.simulation.model_outputs import (
    ModeSubset,
    between_samples,
    driven_outputs,
    free_outputs,
    split_modes,
    systems_of,
)

Array = NDArray[np.float64]
Places = NDArray[np.intp]

LARGEST_RESIDUAL = 10.0
"""Largest residual before a simulation is not believed, in multiples of the measured output's rms
in the record that moves it most. Where other axes are flown, a loop holds an output well below its
disturbances and what feeds through, but no model that is right diverges so far."""
AT_ONCE = 2_000_000
"""Samples of derivatives that are worked on together."""
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class _SystemRun:
    """One system of a model over records of one length.

    Attributes
    ----------
    modes : list of ModeSubset
    inputs : list of int
        Its inputs among those of the records.
    rows, places : list of int
        Fitted outputs among those of the records, and of the system.
    """

    modes: list[ModeSubset]
    inputs: list[int]
    rows: list[int]
    places: list[int]


_Followed = tuple[list[FollowedRun], dict[int, tuple[list[_SystemRun], Array, MotionBasis]]]
"""Runs beside records, and what they have in common by the length of records."""


def _are_same(one: GreyBoxModel, other: GreyBoxModel) -> bool:
    """Whether two models are copies of one structure with the same values."""
    if type(one) is not type(other):
        return False
    held = (f.name for f in fields(one) if f.name not in ("parameters", "estimated"))
    values = [[p.value for p in each.parameters.values()] for each in (one, other)]
    return values[0] == values[1] and all(getattr(one, n) is getattr(other, n) for n in held)


@dataclass(frozen=True)
class ModelResiduals:
    """Measured less modelled outputs of all records, for model after model.

    Attributes
    ----------
    linear : LinearEstimate
        Holds the records.
    outputs : tuple of str
        Names of the outputs of the records.
    hold : {"band_limited", "first", "zero"}
        What the inputs do between their samples.
    """

    linear: LinearEstimate
    outputs: tuple[str, ...]
    hold: str

    def of(self, model: GreyBoxModel) -> list[Array]:
        """Residuals of each record, shape (n_out, n_samples) each.

        Outputs that no response of the model needs stay as they are. Motion from unknown states
        depends on the length of a record only.

        Raises
        ------
        DataError
            The model diverges on the records.
        """
        return [each.rest for each in self._followed(model)[0]]

    def slopes(
        self, model: GreyBoxModel, moved: Sequence[tuple[GreyBoxModel, float]]
    ) -> list[Array]:
        """Derivatives of the modelled outputs, shape (n_moved, n_out, n_samples) for each record.

        By differences between a model and others a step away from it, initial states and trims
        held and then fitted anew.

        Parameters
        ----------
        model : GreyBoxModel
        moved : sequence of (GreyBoxModel, float)
            Other models, each with its step.

        Reference
        ---------
        Golub & Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares
        problems whose variables separate", *SIAM J. Numerical Analysis* 10 (1973).
        """
        followed, known = self._followed(model)
        kept = self._kept(model)
        changes = [np.zeros((len(moved), *each.shape)) for each in self.linear.output_records]
        turns = [np.zeros((len(moved), len(each.start))) for each in followed]
        for n, (_, free, unknown) in known.items():
            alike = [place for place, change in enumerate(changes) if change.shape[2] == n]
            runs = [followed[each] for each in alike]
            starts = np.array([one.start for one in runs])
            left = np.array([one.weighed(kept).ravel() for one in runs])
            alone = np.array([one.fitter.left_alone for one in runs]).transpose(1, 0, 2)
            pulls = [one.pulls(kept, unknown) for one in runs]
            for place, (other, step) in enumerate(moved):
                motions, beyond = self._motion(other, kept, n, known[n][0])
                turned = (beyond - free) / step
                flat = turned.reshape(len(free), -1)
                by_start = (starts @ flat).reshape(len(alike), len(kept), n)
                # What is left of the outputs turns with the space that was taken out of them.
                turning = left @ flat.T / unknown.lengths
                answered = alone @ turned.transpose(1, 2, 0)
                for row, (each, one) in enumerate(zip(alike, runs, strict=True)):
                    driven = self._driven(motions, kept, self._between[each], n)
                    pushed = (driven - one.driven) / step
                    change = pushed + by_start[row]
                    changes[each][place, kept] = change - change.mean(axis=1, keepdims=True)
                    turns[each][place] = turning[row] + one.reweighing(
                        pulls[row], pushed, answered[:, row], unknown.lengths
                    )
        for change, turn, one in zip(changes, turns, followed, strict=True):
            _take_motion_out(change, kept, one.fitter, known[change.shape[2]][2], turn)
        return changes

    def _kept(self, model: GreyBoxModel) -> Places:
        fitted = {each.output for each in model.responses}
        return np.array([row for row, name in enumerate(self.outputs) if name in fitted])

    def _followed(self, model: GreyBoxModel) -> _Followed:
        """The records beside a model: a search asks for what is left, its slopes and errors."""
        if not (self._last and _are_same(self._last[0][0], model)):
            self._last[:] = [(model, self._follow(model))]
        return self._last[0][1]

    @cached_property
    def _last(self) -> list[tuple[GreyBoxModel, _Followed]]:
        return []

    def _follow(self, model: GreyBoxModel) -> _Followed:
        kept = self._kept(model)
        known: dict[int, tuple[list[_SystemRun], Array, MotionBasis]] = {}
        found = []
        for measured, between in zip(self.linear.output_records, self._between, strict=True):
            n = measured.shape[1]
            if n not in known:
                motions, free = self._motion(model, kept, n)
                known[n] = motions, free, MotionBasis.of(free)
            motions, _, unknown = known[n]
            driven = self._driven(motions, kept, between, n)
            rest = measured[kept] - driven
            if not np.all(np.isfinite(rest)):
                raise self._diverges(kept, "a simulation without bounds")
            rest = rest - rest.mean(axis=1, keepdims=True)
            fitter = unknown.fitter(rest)
            start = unknown.coefficients(fitter, rest) / unknown.lengths
            left = measured.copy()
            left[kept] = unknown.less(fitter, rest)
            self._check(kept, left)
            found.append(FollowedRun(left, driven, fitter, start))
        return found, known

    def _driven(self, motions: list[_SystemRun], kept: Places, between: Array, n: int) -> Array:
        found = np.zeros((len(kept), n))
        for each in motions:
            outputs = driven_outputs(
                each.modes, between[each.inputs], self.linear.sample_time_s, self.hold
            )
            found[np.searchsorted(kept, each.rows)] += outputs[each.places]
        return found

    @cached_property
    def _between(self) -> list[Array]:
        """Inputs of each record, with what they do between their samples."""
        return [between_samples(each, self.hold) for each in self.linear.input_records]

    def _motion(
        self, model: GreyBoxModel, kept: Places, n: int, like: Sequence[_SystemRun] = ()
    ) -> tuple[list[_SystemRun], Array]:
        """How each system of a model moves, and what unknown states and trims add.

        `like` are runs of a model that is hardly another, in whose states it moves.
        """
        step = self.linear.sample_time_s
        motions, free = [], []
        for place, each in enumerate(systems_of(model)):
            if np.max(each.delays_s, initial=0.0) > n * step:
                raise self._diverges(kept, "a delay longer than the record")
            modes = split_modes(each, n * step, like[place].modes if like else ())
            inputs = self._columns(each.inputs)
            rows = [k for k in kept if self.outputs[k] in each.outputs]
            places = [each.outputs.index(self.outputs[k]) for k in rows]
            motions.append(_SystemRun(modes, inputs, rows, places))
            moving = free_outputs(modes, n, step)
            wide = np.zeros((len(moving), len(kept), n))
            wide[:, np.searchsorted(kept, rows)] = moving[:, places]
            free.append(wide)
        together = np.concatenate(free)
        if not np.all(np.isfinite(together)):
            raise self._diverges(kept, "a simulation without bounds")
        return motions, together

    def _columns(self, names: Sequence[str]) -> list[int]:
        """Places of inputs in the records; what one that is not there did, nobody knows."""
        held = self.linear.inputs
        missing = [name for name in names if name not in held]
        if missing:
            raise DataError(
                "the model cannot be followed over the records of the response",
                found=f"no samples of its input {', '.join(missing)}",
                needed=f"every input of the model; the response holds {', '.join(held)}",
                action="estimate the response with all inputs, or leave these out of the model",
            )
        return [held.index(name) for name in names]

    @cached_property
    def _sizes(self) -> Array:
        """Rms of each measured output, mean taken off, in the record that moves it most."""
        sizes = [np.std(each, axis=1) for each in self.linear.output_records]
        return np.asarray(np.max(sizes, axis=0))

    def _check(self, kept: Places, left: Array) -> None:
        for row in kept:
            if np.std(left[row]) > LARGEST_RESIDUAL * self._sizes[row]:
                ratio = float(np.std(left[row]) / max(self._sizes[row], TINY))
                found = f"a residual {ratio:.0f} times the measured output"
                raise self._diverges(np.array([row]), found)

    def _diverges(self, rows: Places, found: str) -> DataError:
        names = ", ".join(self.outputs[row] for row in rows)
        return DataError(
            f"the model cannot be followed over the records of output {names}",
            found=found,
            needed="a simulation that stays near the measured output",
            action="check the structure, or fit shorter records",
        )


def _take_motion_out(
    change: Array, kept: Places, fitter: MotionFitter, unknown: MotionBasis, turn: Array
) -> None:
    """Take initial states and trims out of derivatives, and add what their own turning leaves.

    `turn`, shape (n_moved, n_unknowns), says how the residual sees the turning motions.
    """
    at_once = max(1, AT_ONCE // max(change[0].size, 1))
    for begin in range(0, len(change), at_once):
        part = slice(begin, begin + at_once)
        again = np.tensordot(turn[part] @ fitter.normal, unknown.motions, axes=1)
        change[part, kept] = unknown.less(fitter, change[part, kept]) + again
