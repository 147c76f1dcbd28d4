"""Studies: the only place that chains stages, from a study file to a report."""

from flightid.study.run import run_study
from flightid.study.settings import Settings
from flightid.study.study import Study

__all__ = ["Settings", "Study", "run_study"]
