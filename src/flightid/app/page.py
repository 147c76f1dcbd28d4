"""The built page, as it lies in the package: a few files, read once."""

from __future__ import annotations

from pathlib import Path

from flightid.errors import OptionError

FOLDER = Path(__file__).parent / "page"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


def page_files(folder: Path = FOLDER) -> dict[str, tuple[str, bytes]]:
    """Type and content of every file of the page, by its path.

    Raises
    ------
    OptionError
        The page was not built into this installation.
    """
    if not (folder / "index.html").is_file():
        raise OptionError(
            "the page is not in this installation",
            found=f"no {folder / 'index.html'}",
            needed="the built page",
            action="install a wheel; in a checkout: make app",
        )
    return {
        path.relative_to(folder).as_posix(): (TYPES[path.suffix], path.read_bytes())
        for path in sorted(folder.rglob("*"))
        if path.suffix in TYPES
    }
