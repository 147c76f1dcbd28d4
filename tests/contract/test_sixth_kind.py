"""A kind of model that nobody knows works everywhere once it stands in the tables.

One line in `models/kinds.py`, one in `identification/methods.py`: no other file is touched.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.identification import methods, uncertain_of
from flightid.identification.black_box import (
    BlackBoxEstimates,
    BlackBoxRuns,
    black_box_fit,
    provenance_of,
)
from flightid.identification.details import Details
from flightid.identification.local_minimum import LocalMinimum
from flightid.models import EstimateProvenance, LinearSystem, Model
from flightid.models.kinds import KINDS, ModelKind
from flightid.models.sampled.coefficients import coefficients
from flightid.uncertainty.estimate import Estimate


@dataclass(frozen=True)
class LeakStructure:
    """What is asked: an output that leaks towards one input."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class LeakModel:
    """y(t+1) = (1 - leak) y(t) + leak u(t)."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    sample_time_s: float
    leak: float
    units: Mapping[str, str] = field(default_factory=dict)
    name: str = "leak"
    estimated: EstimateProvenance | None = None

    @property
    def parameters(self):
        return coefficients(["leak"], [self.leak], ["1"])

    def with_values(self, values):
        return replace(self, leak=values.get("leak", self.leak))

    def linear_system(self):
        a, b = [[1.0 - self.leak]], [[self.leak]]
        return LinearSystem(
            a, b, [[1.0]], [[0.0]], self.inputs, self.outputs,
            sample_time_s=self.sample_time_s, units=self.units,
        )  # fmt: skip

    def summary(self):
        return self.linear_system().summary()

    def to_dict(self):
        return {
            "schema": "test.leak/1",
            "kind": "leak",
            "name": self.name,
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "sample_time_s": self.sample_time_s,
            "leak": self.leak,
            "units": dict(self.units),
        }

    @classmethod
    def from_dict(cls, content):
        kept = {key: value for key, value in content.items() if key not in ("schema", "kind")}
        names = {key: tuple(kept[key]) for key in ("inputs", "outputs")}
        return cls(**{**kept, **names})


def fit_leak(structure: LeakStructure, record: fid.Record) -> fid.Fit:
    """Least squares of y(t+1) - y(t) on u(t) - y(t)."""
    (u,), (y,) = structure.inputs, structure.outputs
    step, pull = np.diff(record[y]), (record[u] - record[y])[:-1]
    leak = float(pull @ step / (pull @ pull))
    errors = (step - leak * pull)[None]
    variance = float(np.mean(errors**2)) / float(pull @ pull)
    units = {name: record.unit(name) for name in (u, y)}
    model = LeakModel((u,), (y,), record.sample_time_s, leak, units)
    free = fid.simulate(model, record)[y][None]
    estimate = Estimate("leak", leak, "1", np.sqrt(variance), status="free")
    return black_box_fit(
        model,
        BlackBoxRuns((record,), (free,), (errors,)),
        BlackBoxEstimates({"leak": estimate}, ("leak",), np.array([[variance]])),
        (LocalMinimum(float(np.sum(errors**2)), 1, {"leak": leak}, "regression"),),
        iterations=0,
        noise_covariance=np.array([[float(np.mean(errors**2))]]),
        findings=(),
        provenance=provenance_of("leak", [record], [], {}),
        details=Details(),
    )


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(KINDS, "leak", ModelKind(LeakModel, LeakModel.from_dict, LeakModel.to_dict))
    line = methods.Method("leak", (LeakStructure,), methods.RECORDS, fit_leak)
    monkeypatch.setattr(methods, "METHODS", [*methods.METHODS, line])


@pytest.mark.usefixtures("registered")
def test_a_sixth_kind_needs_its_folder_and_its_lines_in_the_tables(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    truth = LeakModel(("u",), ("y",), 0.1, 0.2, {"u": "V", "y": "V"})
    record = fid.Record.from_arrays(
        np.arange(400) * 0.1,
        inputs={"u": np.sign(random.standard_normal(400))},
        outputs={"y": np.zeros(400)},
        units=truth.units,
    )
    record = record.replace({"y": fid.simulate(truth, record)["y"]})
    record = record.replace({"y": record["y"] + 1e-3 * random.standard_normal(400)})
    fit = fid.identify(LeakStructure(("u",), ("y",)), record)
    assert isinstance(fit.model, Model)
    assert fit.parameters["leak"].value == pytest.approx(0.2, abs=0.01)
    assert fid.predict(fit, record).fit_percent["y"] > 99.0
    assert fid.verify([fit, truth], record, names=["fit", "truth"]) is not None
    assert fid.residual_tests(fit).tests
    mode = fid.modes(fit).modes[0]
    assert mode.real.interval95 is not None
    assert uncertain_of(fit).carried(lambda model: model.leak).stderr[0] > 0.0
    # Alone its loop is nearest to -1 at the frequency of Nyquist, above the band of its record.
    assert fid.margins(fit).sensitivity_peak.value == pytest.approx(1.125, abs=0.01)
    closed = fid.margins(fit, controller=2.0)
    assert closed.crossover.interval95 is not None
    assert closed.phase_margin.interval95 is not None
    fid.export(fit, tmp_path / "leak.c")
    back = fid.load_model(fid.write_model(fit, tmp_path / "leak.toml"))
    assert back.leak == fit.model.leak
    assert np.array_equal(uncertain_of(back).covariance, fit.covariance)
    assert "leak" in fit.summary().to_text()
    with pytest.raises(fid.FlightidError, match="no such option"):
        fid.identify(LeakStructure(("u",), ("y",)), record, starts=3)
