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
    FollowedRuns,
    MotionBasis,
    MotionFitter,
)
from flightid.models import GreyBoxModel
from flightid.responses.errors.linear_estimate import LinearEstimate
from flightid.simulation.model_outputs import (
    FINER,
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


@dataclass(frozen=True)
class _CommonBasis:
    """What records of one length have in common beside a model.

    Attributes
    ----------
    systems : list of _SystemRun
    free : ndarray, shape (n_unknowns, n_fitted, n)
        Motion by each unknown.
    basis : MotionBasis
        The same, ready for least squares.
    """

    systems: list[_SystemRun]
    free: Array
    basis: MotionBasis


_Followed = dict[int, tuple[_CommonBasis, list[FollowedRuns]]]
"""By the length of records: what they have in common, and their runs."""


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
        found = list(self.linear.output_records)
        for _, groups in self._followed(model).values():
            for runs in groups:
                for place, rest in zip(runs.places, runs.rest, strict=True):
                    found[place] = rest
        return found

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
        kept = self._kept(model)
        all_kept = len(kept) == len(self.outputs)  # a slice is no copy
        rows = slice(None) if all_kept else kept
        found = [np.zeros(0)] * len(self.linear.output_records)
        for n, (motion, groups) in self._followed(model).items():
            shape = len(moved), len(self.outputs), n
            space = np.empty if all_kept else np.zeros
            wholes = [space((len(runs.places), *shape)) for runs in groups]
            sides = [_Side.of(runs, kept, motion) for runs in groups]
            for place, (other, step) in enumerate(moved):
                systems, beyond = self._motion(other, kept, n, motion.systems)
                beyond -= motion.free
                beyond /= step
                for whole, side in zip(wholes, sides, strict=True):
                    driven = self._driven(systems, kept, side.runs.places)
                    whole[:, place, rows] = side.moved(driven, step, beyond)
            for whole, side in zip(wholes, sides, strict=True):
                turns = np.stack(side.turns, axis=1)
                _take_motion_out(whole, rows, side.runs.fitter, motion.basis, turns)
                for place, change in zip(side.runs.places, whole, strict=True):
                    found[place] = change
        return found

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
        found: _Followed = {}
        for n, groups in self._alike.items():
            systems, free = self._motion(model, kept, n)
            motion = _CommonBasis(systems, free, MotionBasis.of(free))
            found[n] = motion, [self._beside(kept, motion, places) for places in groups]
        return found

    def _beside(self, kept: Places, motion: _CommonBasis, places: tuple[int, ...]) -> FollowedRuns:
        """Records of one length beside a model."""
        left = np.array([self.linear.output_records[place] for place in places])
        driven = self._driven(motion.systems, kept, places)
        rest = left[:, kept] - driven
        if not np.all(np.isfinite(rest)):
            raise self._diverges(kept, "a simulation without bounds")
        rest -= rest.mean(axis=2, keepdims=True)
        unknown = motion.basis
        fitter = unknown.fitter(rest)
        start = unknown.coefficients(fitter, rest[:, None])[:, 0]
        left[:, kept] = rest - unknown.moved(start)
        self._check(kept, left)
        return FollowedRuns(places, left, driven, fitter, start / unknown.lengths)

    @cached_property
    def _alike(self) -> dict[int, list[tuple[int, ...]]]:
        """Places of records by their length, in groups of so many samples as are worked on."""
        found: dict[int, list[tuple[int, ...]]] = {}
        for place, each in enumerate(self.linear.output_records):
            groups = found.setdefault(each.shape[1], [])
            most = AT_ONCE // (max(each.shape[0], FINER * len(self.linear.inputs)) * each.shape[1])
            if groups and len(groups[-1]) < most:
                groups[-1] = (*groups[-1], place)
            else:
                groups.append((place,))
        return found

    def _driven(
        self, systems: Sequence[_SystemRun], kept: Places, places: tuple[int, ...]
    ) -> Array:
        """What the inputs of records of one length drive, shape (n_records, n_fitted, n)."""
        between = self._between[places]
        n = self.linear.output_records[places[0]].shape[1]
        found = None if len(systems) == 1 else np.zeros((len(places), len(kept), n))
        for each in systems:
            is_all = each.inputs == list(range(between.shape[1]))
            inputs = between if is_all else between[:, each.inputs]
            outputs = driven_outputs(each.modes, inputs, self.linear.sample_time_s, self.hold)
            if found is None:  # all fitted outputs are its own
                return _taken(outputs, each.places)
            found[:, np.searchsorted(kept, each.rows)] += outputs[:, each.places]
        return np.asarray(found)

    @cached_property
    def _between(self) -> dict[tuple[int, ...], Array]:
        """Inputs of each group, with what they do between their samples."""
        inputs = self.linear.input_records
        return {
            places: np.array([between_samples(inputs[place], self.hold) for place in places])
            for groups in self._alike.values()
            for places in groups
        }

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
            moving = _taken(free_outputs(modes, n, step), places)
            if len(rows) < len(kept):
                wide = np.zeros((len(moving), len(kept), n))
                wide[:, np.searchsorted(kept, rows)] = moving
                moving = wide
            free.append(moving)
        together = free[0] if len(free) == 1 else np.concatenate(free)
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
        deviations = np.max(np.std(left[:, kept], axis=2), axis=0)
        for row, deviation in zip(kept, deviations, strict=True):
            if deviation > LARGEST_RESIDUAL * self._sizes[row]:
                ratio = float(deviation / max(self._sizes[row], TINY))
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


def _taken(outputs: Array, places: list[int]) -> Array:
    """Some outputs of a system, which are most often all of them; a copy costs as much as a sum."""
    return outputs if places == list(range(outputs.shape[1])) else outputs.take(places, axis=1)


@dataclass(frozen=True)
class _Side:
    """Records of one length, and what each moved model is compared with.

    Attributes
    ----------
    runs : FollowedRuns
    unknown : MotionBasis
    weighed : ndarray, shape (n_records, n_fitted n)
        What is left, by the squares of the outputs' weights.
    pulls : ndarray, shape (n_records, n_unknowns, n_fitted)
    turns : list of ndarray, shape (n_records, n_unknowns)
        How the residuals see the motions of each moved model turn.
    """

    runs: FollowedRuns
    unknown: MotionBasis
    weighed: Array
    pulls: Array
    turns: list[Array]

    @classmethod
    def of(cls, runs: FollowedRuns, kept: Places, motion: _CommonBasis) -> _Side:
        """Of some records beside a model."""
        weighed = runs.weighed(kept).reshape(len(runs.places), -1)
        return cls(runs, motion.basis, weighed, runs.pulls(kept, motion.basis), [])

    def moved(self, driven: Array, step: float, turned: Array) -> Array:
        """Derivatives by one parameter, means removed, shape (n_records, n_fitted, n).

        In place of `driven`, what a moved model drives.
        """
        runs, lengths = self.runs, self.unknown.lengths
        driven -= runs.driven
        driven /= step
        pushed = driven
        flat = turned.reshape(len(turned), -1)
        # What is left of the outputs turns with the space that was taken out of them.
        turning = self.weighed @ flat.T / lengths
        alone = runs.fitter.left_alone.transpose(1, 0, 2)
        answered = (alone @ turned.transpose(1, 2, 0)).transpose(1, 0, 2)
        self.turns.append(turning + runs.reweighing(self.pulls, pushed, answered, lengths))
        pushed += (runs.start @ flat).reshape(pushed.shape)
        pushed -= pushed.mean(axis=2, keepdims=True)
        return pushed


def _take_motion_out(
    changes: Array, rows: slice | Places, fitter: MotionFitter, unknown: MotionBasis, turns: Array
) -> None:
    """Take initial states and trims out of derivatives, and add what their own turning leaves.

    `changes`, shape (n_records, n_moved, n_out, n), are derivatives, `rows` the fitted outputs;
    `turns`, shape (n_records, n_moved, n_unknowns), says how the residuals see the turning motions.
    """
    for place, change in enumerate(changes):  # one record's stay near
        rest = change[None, :, rows]
        alone = fitter.of(place)
        again = turns[place] @ alone.normal[0] - unknown.coefficients(alone, rest)[0]
        rest[0] += unknown.moved(again)
        if not isinstance(rows, slice):
            change[:, rows] = rest[0]
