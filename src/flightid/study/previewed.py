"""A study of which single stages are looked at: settings and tasks as a whole run reads them."""

from __future__ import annotations

from pathlib import Path

from flightid.errors import StudyError, UnknownNameError
from flightid.frozen import dataclass
from flightid.study.settings import Settings, read_settings
from flightid.study.task import Task, load_task


@dataclass(frozen=True, eq=False)
class PreviewedStudy:
    """Settings of a study, with what each of its models needs loaded.

    Attributes
    ----------
    path : Path
    settings : Settings
    """

    path: Path
    settings: Settings

    @staticmethod
    def of(path: str | Path) -> PreviewedStudy:
        """Read a study file."""
        return PreviewedStudy(Path(path), read_settings(Path(path)))

    @property
    def folder(self) -> Path:
        """From which the study names its data."""
        return self.path.parent

    def tasks(self) -> list[Task]:
        """All its models, where their data are there to be looked at.

        Raises
        ------
        StudyError
            The study would have to fly first.
        """
        if self.settings.flight is not None:
            raise StudyError(
                "a preview takes a log or records, and this study flies first",
                needed="[log] or [[record]]",
                action="flightid run writes the log of the flight; name that",
            )
        return [load_task(each, self._names) for each in self.settings.models]

    def task(self, name: str) -> Task:
        """One of its models alone, without its data.

        Raises
        ------
        UnknownNameError
            It has no such model.
        """
        for each in self.settings.models:
            if each.name == name:
                return load_task(each, self._names)
        needed = "one of " + ", ".join(self._names)
        raise UnknownNameError("the study has no such model", found=name, needed=needed)

    @property
    def _names(self) -> tuple[str, ...]:
        return tuple(each.name for each in self.settings.models)
