"""Scans of orders for a proposal: stages of the study that it writes, which finds them done."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from flightid.conventions import Role
from flightid.errors import StudyError
from flightid.frozen import dataclass
from flightid.identification.prediction.predict import predict
from flightid.models import NarxStructure
from flightid.reading import parse_toml
from flightid.record import Record
from flightid.responses.coherent_pairs import DRIVING_DECADES
from flightid.simulation.metrics import rms_error
from flightid.study.conditioning import Conditioning, outliers_first
from flightid.study.kind_scans import scan_narx, scan_subspace
from flightid.study.reading import TableReader
from flightid.study.record_files import RecordFile, load_records, read_record_file
from flightid.study.response_settings import ResponseSettings
from flightid.study.stage_runner import StageResult, StageRunner
from flightid.study.stages import (
    estimate,
    fit_without_equations,
    scan_records,
    select_coherent,
)
from flightid.study.structure_settings import SUBSPACE, StructureSettings
from flightid.study.taking import conditioned
from flightid.study.task import narrowed
from flightid.surface import as_key, speaking
from flightid.validation import OrderScan
from flightid.validation.order_scan.result import OrderTrial

FAR = 1.25
"""Ratio of free-run errors that refining a subspace estimate does not make up for."""
Orders = Mapping[str, tuple[int, ...]]
Band = tuple[float, float]


def record_file(lines: Sequence[str], folder: Path) -> RecordFile:
    """What a study says of a record in the lines of its table, read as the study reads them."""
    rows = parse_toml("\n".join(lines), "a study file", "proposal", StudyError)["record"]
    return read_record_file(TableReader(rows[0], "[[record]]"), folder)


@dataclass(frozen=True)
class ProposedScans:
    """Scans of the structures that a proposal weighs, on the records as its study will read them.

    A scan depends on files, spans, channels and orders alone, so the cache of stages gives that of
    the structure that was taken to the study; where the study's differ in any, it scans anew. Its
    inputs are those whose responses the study finds coherent, in the same stages.

    Attributes
    ----------
    fitted, choice : RecordFile
        What is fitted, and what ranks structures.
    inputs, outputs, injected : tuple of str
        Channels of all models of the study; injected ones are read with what is fitted.
    runner : StageRunner
    conditioning : tuple of Conditioning
        Steps of the study, by the names of its records.
    """

    fitted: RecordFile
    choice: RecordFile
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    injected: tuple[str, ...]
    runner: StageRunner
    conditioning: tuple[Conditioning, ...] = ()

    @cached_property
    def _records(self) -> tuple[StageResult[list[Record]], StageResult[list[Record]]]:
        """Loaded and conditioned as the study does it."""
        roles = {
            **dict.fromkeys(self.inputs, Role.INPUT),
            **dict.fromkeys(self.outputs, Role.OUTPUT),
        }
        beside = dict.fromkeys(self.injected, Role.EXCITATION)
        first, second = (
            self._record(file, channels)
            for file, channels in ((self.fitted, beside | roles), (self.choice, roles))
        )
        return first, second

    def _record(self, file: RecordFile, channels: Mapping[str, Role]) -> StageResult[list[Record]]:
        first = outliers_first(self.conditioning, file, channels)
        read = self.runner.stage(f"record: {file.name}", load_records, file, channels, first)
        steps = self.conditioning
        return conditioned({file.name: read}, (file,), steps, self.runner, {})[file.name]

    def driving(self, outputs: tuple[str, ...], band_rad_s: Band | None) -> tuple[str, ...]:
        """Inputs that the study will take for outputs: those whose responses are coherent.

        Parameters
        ----------
        outputs : tuple of str
            Of one model.
        band_rad_s : tuple of float or None
            Of the model in the study; None: it estimates no response and takes all inputs.

        Raises
        ------
        FlightidError
            The study could not read the records, or not estimate the responses.
        """
        if band_rad_s is None:
            return self.inputs
        asked = ResponseSettings()
        response = self.runner.stage(
            f"response: {', '.join(outputs)}, {asked.estimator}",
            estimate,
            [self._records[0]],
            self.inputs,
            outputs,
            band_rad_s,
            asked.estimator,
            asked.of_estimates,
        )
        limits = (asked.minimum_coherence, DRIVING_DECADES, False, True)
        name = f"coherence: {', '.join(outputs)}"
        found = self.runner.stage(name, select_coherent, response, *limits).value
        kept = {name.split("/", 1)[1] for name in found.names}
        # Where none is coherent the study gives no model, whatever is scanned.
        return tuple(name for name in self.inputs if name in kept) or self.inputs

    def flown(self, output: str, inputs: tuple[str, ...]) -> Record:
        """What is fitted, inputs and one output of it.

        Raises
        ------
        FlightidError
            The study could not read it.
        """
        (record,) = self._records[0].value
        whole = narrowed(record, inputs, (output,))
        return whole.select([*inputs, output])

    def subspace_errors(
        self,
        outputs: tuple[str, ...],
        inputs: tuple[str, ...],
        settle_s: float,
        alone: Mapping[str, float],
    ) -> dict[str, float] | None:
        """Rms by output of a subspace model's free runs, which the study fits as it is fitted here.

        None where a run diverges. An estimate that runs far worse than models of one output by
        themselves is not refined, which takes most of the time and gains some percent.

        Parameters
        ----------
        outputs, inputs : tuple of str
            Inputs: `driving` ones.
        settle_s : float
            First stretch of a run, s: its start is solved for there, and no score counts it.
        alone : mapping of str to float
            Rms by output of models of one output.

        Raises
        ------
        FlightidError
            The study could not read the records, or fit the model.
        """
        asked = StructureSettings(structure=SUBSPACE, inputs=self.inputs, outputs=outputs)
        asked = replace(asked, coherence=())
        rough = replace(asked, options={"refine": False})
        first = self._joint(rough, inputs, settle_s)
        if first is not None and any(first[name] > FAR * alone[name] for name in outputs):
            return first
        return self._joint(asked, inputs, settle_s)

    def _joint(
        self, asked: StructureSettings, inputs: tuple[str, ...], settle_s: float
    ) -> dict[str, float] | None:
        """Rms by output of the free runs of one model."""
        outputs = asked.outputs
        with speaking(as_key):
            fitted = self.runner.stage(
                f"fit: {', '.join(outputs)}",
                *(fit_without_equations, asked, inputs, [self._records[0]], [], None),
            ).value
        if fitted.fit is None:
            return None
        unseen = [narrowed(each, inputs, outputs) for each in self._records[1].value]
        runs = predict(fitted.fit.model, unseen, settle_s=settle_s)
        if any(run.diverged_at is not None for run in runs):
            return None
        found = {}
        for name in outputs:
            pairs = [run.scored(name) for run in runs]
            measured, predicted = (np.concatenate([pair[i] for pair in pairs]) for i in (0, 1))
            found[name] = float(rms_error(measured, predicted))
        return found

    def scan(self, kind: str, output: str, orders: Orders, inputs: tuple[str, ...]) -> OrderScan:
        """Structures of a kind for an output from `driving` inputs, as the study scans them.

        Raises
        ------
        FlightidError
            The study could not read the records, or no structure could be fitted.
        """
        flown, unseen = ([each] for each in self._records)
        asked = (kind, dict(orders), inputs, (output,), flown, unseen)
        # Findings of its fit stand in the study's report, in the words of the study.
        with speaking(as_key):
            return self.runner.stage(f"orders: {output}, {kind}", scan_records, *asked).value

    def narx(self, structures: Sequence[NarxStructure], settle_s: float) -> list[OrderTrial]:
        """NARX structures of an output, which run over the same samples as those of `scan`.

        Parameters
        ----------
        structures : sequence of NarxStructure
            Of `driving` inputs.
        settle_s : float
            First stretch of a run that no score counts, s.

        Raises
        ------
        FlightidError
            The study could not read the records.
        """
        flown, unseen = ([each] for each in self._records)
        with speaking(as_key):
            return self.runner.stage(
                f"lags: {structures[0].output}, narx",
                *(scan_narx, [*structures], settle_s, flown, unseen),
            ).value

    def subspace(self, output: str, inputs: tuple[str, ...], settle_s: float) -> OrderTrial | None:
        """The best subspace model of an output from `driving` inputs, over the samples of `scan`.

        Raises
        ------
        FlightidError
            The study could not read the records.
        """
        flown, unseen = ([each] for each in self._records)
        asked = (scan_subspace, inputs, output, settle_s, flown, unseen)
        with speaking(as_key):
            return self.runner.stage(f"orders: {output}, subspace", *asked).value
