"""What a study made of one model, of any kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from flightid.conventions import Light
from flightid.evidence.data_checks import sample_checks
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification import Fit, Reduction
from flightid.identification.prediction.request import FREE_RUN
from flightid.models import Model
from flightid.record import Record
from flightid.responses import CoherentPairs, FrequencyResponse
from flightid.study.model_settings import ModelSettings
from flightid.study.structures import Choice, goal_findings
from flightid.validation import Comparison, ResidualTests, SpectrumComparison, Verification
from flightid.validation.verification.of_the_fit import SEEN

LEFT_OUT = "left-out"
"""Code of an input without coherence."""


@dataclass(frozen=True, eq=False)
class ModelFits:
    """Result of the fit of one model.

    Attributes
    ----------
    fits : mapping of str to Fit
        By estimator of the response, or by method; the first counts. None where no input is left.
    reduction : Reduction or None
        How the structure of the fits came about, where the study asks for a reduction.
    choice : OrderScan, NarxSearch or None
        Structures that were tried, where there were several.
    refused : Finding or None
        Why the data allow no fit, where other models of the study stand without it.
    """

    fits: Mapping[str, Fit] = field(default_factory=dict)
    reduction: Reduction | None = None
    choice: Choice | None = None
    refused: Finding | None = None

    @property
    def fit(self) -> Fit | None:
        """The fit that counts."""
        return next(iter(self.fits.values()), None)


@dataclass(frozen=True, eq=False)
class ModelResults:
    """What a study made of one model.

    Attributes
    ----------
    settings : ModelSettings
        What was asked.
    responses : mapping of str to FrequencyResponse
        By estimator; the first is the one that counts.
    coherent : CoherentPairs or None
        Which responses were fitted, or which inputs, where coherence chose them.
    fitted : ModelFits
        The fits and how they came about.
    tests : ResidualTests or None
        Of the residuals of a fit to records.
    verifications : mapping of str to Verification or Comparison
        By record, none of which the fit has seen; side by side where there are rivals.
    spectra : SpectrumComparison or None
        Of the first record of the responses, measured and in free run.
    reference : Model or None
        Model that stands beside the estimates.
    reduction_judged : tuple of Finding
        Whether the reduced model predicts unseen records as the full one does.
    training : tuple of Record
        What a structure without equations was fitted to, or what fitted responses were made of.
    unfitted : tuple of Record
        What chose the structure and what verifies: damage in them counts as in the others.
    untested : tuple of Finding
        Why there are no residual tests or spectra, where they were asked for.
    """

    settings: ModelSettings
    responses: Mapping[str, FrequencyResponse]
    coherent: CoherentPairs | None = None
    fitted: ModelFits = field(default_factory=ModelFits)
    tests: ResidualTests | None = None
    verifications: Mapping[str, Verification | Comparison] = field(default_factory=dict)
    spectra: SpectrumComparison | None = None
    reference: Model | None = None
    reduction_judged: tuple[Finding, ...] = ()
    training: tuple[Record, ...] = ()
    unfitted: tuple[Record, ...] = ()
    untested: tuple[Finding, ...] = ()

    @property
    def name(self) -> str:
        """Name of the model in the study."""
        return self.settings.name

    @property
    def response(self) -> FrequencyResponse | None:
        """The response that counts; None where there is none."""
        return next(iter(self.responses.values()), None)

    @property
    def fits(self) -> Mapping[str, Fit]:
        """By estimator of the response, or by method; the first counts."""
        return self.fitted.fits

    @property
    def fit(self) -> Fit | None:
        """The fit that counts; None where no input of a structure is coherent."""
        return self.fitted.fit

    @property
    def reduction(self) -> Reduction | None:
        """How the structure of the fits came about."""
        return self.fitted.reduction

    @property
    def choice(self) -> Choice | None:
        """Structures that were tried."""
        return self.fitted.choice

    @property
    def left_out(self) -> tuple[Finding, ...]:
        """Inputs of a structure without coherence, or the whole model, with the reason.

        Where nothing was fitted, damage in the samples comes first: it takes coherence too.
        """
        reasons = self._reasons
        return (*self._damage, *reasons) if reasons and self.fit is None else reasons

    @property
    def _damage(self) -> tuple[Finding, ...]:
        """What was found in the samples that no fit tells of, for none was made."""
        responses = tuple(self.responses.values())[:1]
        data = (*self.training, *self.unfitted) or responses
        named = self.settings.structure or next(iter(responses), None)
        if named is None:
            return ()
        checks = sample_checks(data, {*named.inputs, *named.outputs})
        return tuple(check.finding for check in checks)

    @property
    def _reasons(self) -> tuple[Finding, ...]:
        if self.fitted.refused is not None:
            return (self.fitted.refused,)
        if self.coherent is None or self.settings.structure is None:
            return ()
        return tuple(
            Finding(LEFT_OUT, Light.UNKNOWN, f"{pair.name} is left out: {pair.reason}")
            for pair in self.coherent.pairs
            if not pair.kept and pair.name.split("/")[1] in self.settings.structure.inputs
        )

    @property
    def choice_findings(self) -> tuple[Finding, ...]:
        """Verdicts of the search on its first structure, where that one is taken."""
        structure = self.settings.structure
        if self.choice is None or structure is None or structure.rule != "free_run":
            return ()
        return self.choice.findings

    @property
    def on_unseen(self) -> dict[str, Verification]:
        """Free runs of the fitted model through records that it has not seen, by their names.

        A record that the study calls unseen, yet holds samples of the fit, is none.
        """
        found = {
            name: each.first if isinstance(each, Comparison) else each
            for name, each in self.verifications.items()
        }
        free = {name: run for name, run in found.items() if run.horizon == FREE_RUN}
        seen = {name for name, run in free.items() if any(f.code == SEEN for f in run.findings)}
        return {name: run for name, run in free.items() if name not in seen}

    @property
    def findings_of_choice(self) -> tuple[Finding, ...]:
        """Verdicts on how the structure came about, and on spectra."""
        if self.settings.structure is None:
            return ()
        chosen = (*self.left_out, *self.choice_findings, *goal_findings(self.fit))
        return (*chosen, *(() if self.spectra is None else self.spectra.findings))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdicts of every stage that counts."""
        has_equations = self.settings.structure is None
        first = self.response.findings if has_equations and self.response is not None else ()
        parts = (self.fit, self.tests, *self.verifications.values(), self.spectra)
        path = () if self.reduction is None else self.reduction.path_findings
        found = (each for part in parts if part is not None for each in part.findings)
        chosen = (*self.left_out, *self.choice_findings, *goal_findings(self.fit))
        return (*first, *chosen, *path, *self.reduction_judged, *self.untested, *found)

    def to_dict(self) -> dict[str, object]:
        """Plain values of every result."""
        stages = {
            "coherent": self.coherent,
            "choice": self.choice,
            "reduction": self.reduction,
            "residual_tests": self.tests,
            "spectra": self.spectra,
        }
        return {
            "name": self.name,
            "left_out": [finding.to_dict() for finding in self.left_out],
            "responses": {key: value.to_dict() for key, value in self.responses.items()},
            "fits": {key: value.to_dict() for key, value in self.fits.items()},
            **{key: None if part is None else part.to_dict() for key, part in stages.items()},
            "reduction_judged": [finding.to_dict() for finding in self.reduction_judged],
            "verifications": {key: value.to_dict() for key, value in self.verifications.items()},
        }
