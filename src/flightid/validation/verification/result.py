"""The verification: a model's free run beside records that it has not seen."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.prediction.result import Prediction
from flightid.identification.prediction.weights import weighted_error
from flightid.record import Record
from flightid.record.hold import BETWEEN, InputHold
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.validation.verification.muad import Mismatch


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Result, schema="flightid.verification/1"):
    """How a model predicts records, by output.

    Attributes
    ----------
    outputs : tuple of str
        Outputs compared.
    predictions : tuple of Prediction
        One for each record.
    theil, rms_error, mse, fit_percent, vaf, r_squared : mapping of str to float
        By output, over all records together, about the mean of each measured record; errors in
        the output's unit, `fit_percent` and `vaf` in percent.
    overall_theil : float
        Theil coefficient of all outputs together, weighted as `j_rms`; outputs of another kind
        are weighted by their deviation. The guide of 0.25 to 0.30 is meant for this one.
    j_rms : float or None
        Weighted error over all outputs in degrees, deg/s, ft/s and ft/s²; None where an output is
        of another kind.
    horizon : int or "free_run"
        Samples ahead.
    initial_state : str
        Where the runs started, in words.
    state_bias, output_bias : bool
        Which constants were solved for.
    hold : {"zero", "first", "band_limited"} or None
        What inputs do between samples; None of models that know samples alone.
    mismatch : Mismatch or None
        The model's frequency response against a measured one, where one was given.
    findings : tuple of Finding
        Verdicts against the guides.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> time_s = np.arange(300) * 0.02
    >>> lag = fid.LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> flown = fid.Record.from_arrays(time_s, inputs={"u": np.sin(time_s)})
    >>> fid.verify(lag, fid.simulate(lag, flown))
    Verification(1 output, 1 record, 6 s, worst Theil coefficient 0.000)
    """

    outputs: tuple[str, ...]
    predictions: tuple[Prediction, ...]
    theil: Mapping[str, float]
    rms_error: Mapping[str, float]
    mse: Mapping[str, float]
    fit_percent: Mapping[str, float]
    vaf: Mapping[str, float]
    r_squared: Mapping[str, float]
    overall_theil: float
    j_rms: float | None
    horizon: int | str
    initial_state: str
    state_bias: bool
    output_bias: bool
    hold: InputHold | None
    mismatch: Mismatch | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def measured(self) -> Record:
        """The first record."""
        return self.predictions[0].measured

    @property
    def predicted(self) -> Record:
        """The model's free run through the first record."""
        return self.predictions[0].predicted

    @property
    def protocol(self) -> str:
        """What was predicted from what, in one sentence."""
        solved = [
            name
            for name, is_free in (
                ("state biases", self.state_bias),
                ("output biases", self.output_bias),
            )
            if is_free
        ]
        told_s = self.predictions[0].shifts.told_s
        on = "" if told_s is None else f", on its first {told_s:.3g} s"
        shifts = f"; {' and '.join(solved)} solved for in each record{on}" if solved else ""
        if self.horizon != "free_run":
            ahead = "1 sample" if self.horizon == 1 else f"{self.horizon} samples"
            return f"Prediction {ahead} ahead from the measured past."
        left = max(each.start for each in self.predictions)
        over = (
            "after the first stretch, which no score counts," if left else "over the whole record"
        )
        between = "" if self.hold is None else f" ({BETWEEN[self.hold]} between samples)"
        return (
            f"Free run {over} on measured inputs alone{between}, from {self.initial_state}{shifts}."
        )

    def summary(self) -> Table:
        """Table by output, with the horizon and the verdicts below."""
        units = self.measured
        columns = (
            Column("output"),
            Column("unit"),
            Column("Theil coefficient", digits=3),
            Column("rms error", digits=3),
            Column("mean square error", digits=3),
            Column("fit", "%", 4),
            Column("variance accounted for", "%", 4),
            Column("R²", digits=4),
        )
        rows: list[tuple[Cell, ...]] = [
            (
                name,
                units.unit(name),
                self.theil[name],
                self.rms_error[name],
                self.mse[name],
                self.fit_percent[name],
                self.vaf[name],
                self.r_squared[name],
            )
            for name in self.outputs
        ]
        notes = [self.protocol]
        if self.j_rms is not None:
            notes.append(f"W{weighted_error(self.j_rms, map(units.unit, self.outputs))[1:]}.")
        if len(self.outputs) > 1:
            notes.append(f"Theil coefficient of all outputs together {self.overall_theil:.3f}.")
        return Table(repr(self), columns, tuple(rows), (*notes, *map(str, self.findings)))

    def _computed(self) -> dict[str, object]:
        units = {name: self.measured.unit(name) for name in self.outputs}
        return {"protocol": self.protocol, "units": units}

    def __repr__(self) -> str:
        """Size and the worst Theil coefficient on one line."""
        outputs = "1 output" if len(self.outputs) == 1 else f"{len(self.outputs)} outputs"
        count = len(self.predictions)
        records = "1 record" if count == 1 else f"{count} records"
        length_s = sum(prediction.measured.duration_s for prediction in self.predictions)
        return (
            f"Verification({outputs}, {records}, {length_s:.4g} s, "
            f"worst Theil coefficient {max(self.theil.values()):.3f})"
        )
