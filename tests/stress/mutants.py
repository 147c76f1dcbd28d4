"""Change one operator or number at a time and see whether a test fails.

`python -m tests.stress.mutants --sample 200 --keep FILE`, with the extra `mutants`: `make mutants`.

Drawn by chance from all mutants of the packages that tell users what to believe
(`mutations.EQUIVALENT` and its neighbours say what is left out). pytest collects the default suite
once, each file of tests runs in a fork with coverage, and each mutant meets, in a fork of its own
(`mutant_forks.py`): every test that reaches its statement, those of its module and of its room
first, short before long (so many seconds of its processor's time; where that is not all, its end
says so), then the other tests of the nearest files, which may take what a fixture or a cache made
of that line for another. A mutant of what runs on import meets the contracts that read the source,
the tests of files that import its module, and those that reach its file. One that no test notices
is printed: mend the test, or delete what nothing needs.

What tests reach is kept beside the file by the text of the test file; of a source that changed
since, lines that stand elsewhere take their tests with them. Ends are kept for a tree that is the
same. `--again` tries anew what was not noticed. The share is told by package, each with the
interval of Clopper and Pearson, *Biometrika* 26 (1934), 404-413.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.stress.mutations import (
    EQUIVALENT,
    Mutant,
    changed,
    check_equivalent,
    moved,
    mutants,
    mutants_of,
    statement,
    told,
)

ROOT = Path(__file__).parents[2]
PACKAGES = ("logs", "inspection", "evidence", "uncertainty", "control/tuning")
TESTS = ("tests/unit", "tests/truth", "tests/contract", "tests/guide")
"""And the examples of the packages."""
SLOW = ("test_app_", "test_fleet_")
"""They try other packages, in processes of their own."""
READERS = (
    "tests/contract/test_array_classes.py",
    "tests/contract/test_defaults.py",
    "tests/contract/test_named_numbers.py",
    "tests/unit/test_option_readers.py",
)
"""They read the source of classes, numbers and options: no line of it is run by them."""
BUDGET_S, MOST_FILES = 40.0, 3
"""Processor's seconds that tests of a mutant may take, by default; the others of so many files get
half of it. A busy machine takes longer, but tries as many tests."""
PIECES, OFFERED = 5, 6.0
"""Tests of a file run together, for what they share, in so many pieces of that time: else one long
file would stand before the short tests of all others. So many times that time are offered: what
tests take with coverage is more than they take without."""
FILE_S = 600.0
"""Processor's seconds that a file of tests may take with coverage."""
UNNOTICED = ("survived", "not all run", "not reached", "not run")


@dataclass
class Reached:
    """Tests by file and line that they run, and the seconds that each takes."""

    lines: dict[str, dict[int, set[str]]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)

    def take(self, kept: Mapping[str, Any], tree: Path, texts: Path) -> None:
        """Add what a file of tests reaches, where those lines stand now."""
        names = list(kept["seconds"])
        failed = set(kept["failed"])
        self.seconds |= {k: v for k, v in kept["seconds"].items() if k not in failed}
        for file, (digest, of) in kept["lines"].items():
            if not (tree / file).exists():
                continue
            now = (tree / file).read_text(encoding="utf-8")
            same = digest == _digest(now)
            places = {} if same else moved((texts / digest).read_text(encoding="utf-8"), now)
            here = self.lines.setdefault(file, {})
            for line, tests in of.items():
                place = int(line) if same else places.get(int(line), 0)
                here.setdefault(place, set()).update({names[k] for k in tests} - failed)

    def of(self, path: str, places: Sequence[int]) -> set[str]:
        """The tests that run any of those lines."""
        here = self.lines.get(path, {})
        return set().union(*(here.get(line, set()) for line in places))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def copied(folder: Path) -> tuple[Path, str]:
    """The files that git knows or would take, and the native half: where mutants harm nobody.

    With a digest of sources and tests.
    """
    words = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, check=True)
    native = [str(each.relative_to(ROOT)) for each in (ROOT / "src/flightid").glob("_native*.so")]
    digest = hashlib.sha256()
    for name in sorted({*filter(None, listed.stdout.decode().split("\0")), *native}):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
            if name.startswith(("src/", "tests/")):
                digest.update((ROOT / name).read_bytes())
    return folder, digest.hexdigest()[:16]


def reached(forks: Any, tree: Path, kept: Path) -> Reached:
    """What each file of tests reaches: run with coverage, or read where its text is the same."""
    (kept / "texts").mkdir(parents=True, exist_ok=True)
    files: dict[str, list[str]] = {}
    for each in forks.tests:
        files.setdefault(each.partition("::")[0], []).append(each)
    found = Reached()
    for k, (file, tests) in enumerate(files.items()):
        text = (tree / file).read_text(encoding="utf-8")
        place = kept / f"{_digest(file + text)}.json"
        if not place.exists():
            covered = forks.covered(tests, FILE_S)
            if covered is None:
                print(f"{file}: no end with coverage, left out", flush=True)
                continue
            place.write_text(json.dumps(_packed(covered, tree, kept / "texts")))
            told = f"; fail unchanged, left out: {covered.failed}" if covered.failed else ""
            spent = sum(covered.seconds.values())
            print(f"{k + 1}/{len(files)} {file}: {spent:.1f} s{told}", flush=True)
        found.take(json.loads(place.read_text()), tree, kept / "texts")
    return found


def _packed(covered: Any, tree: Path, texts: Path) -> dict[str, Any]:
    """As it is kept: tests by their numbers, and the texts of the files that lines count in."""
    number = {name: k for k, name in enumerate(covered.seconds)}
    lines = {}
    for file, of in covered.lines.items():
        text = (tree / file).read_text(encoding="utf-8")
        (texts / _digest(text)).write_text(text, encoding="utf-8")
        here = {k: [number[each] for each in tests if each in number] for k, tests in of.items()}
        lines[file] = (_digest(text), here)
    return {"seconds": covered.seconds, "failed": covered.failed, "lines": lines}


def end_of(
    forks: Any, mutant: Mutant, text: str, new: str, known: Reached, most_s: float
) -> tuple[str, str]:
    """How a mutant ends, and which test noticed it."""
    tests, others, left_out = chosen(forks, mutant, known, text, most_s)
    if not tests:
        return "not reached", ""
    # Readers of the source take no time: what they notice needs no other test to be collected.
    readers = [each for each in tests if each.partition("::")[0] in READERS]
    rest = [each for each in tests if each not in readers]
    for names, limit_s in ((readers, most_s), (rest, most_s), (others, most_s / 2.0)):
        if not names:
            continue
        longest_s = max(known.seconds.get(each, 1.0) for each in names)
        cpu_s = 30.0 + 3.0 * (limit_s + longest_s)
        ended = forks.tried(mutant.path, new, names, limit_s, cpu_s)
        if ended.end == "endless" and not forks.unchanged(names, limit_s, cpu_s):
            return "not run", "nor do these tests end without it"
        if ended.end != "survived":
            return ended.end, ended.by
        if names is not others:
            left_out += ended.left_out
    return ("not all run", f"{left_out} left out") if left_out else ("survived", "")


def chosen(
    forks: Any, mutant: Mutant, known: Reached, text: str, most_s: float
) -> tuple[list[str], list[str], int]:
    """Tests that reach it, the others of the nearest files, and how many there was no time for."""
    at = known.of(mutant.path, statement(text, mutant.line))
    here = known.lines.get(mutant.path, {})
    readers: list[str] = []
    if not at:
        # What runs on import belongs to no test: those of files that import the module, and those
        # of its whole file, stand for it; where all of the file runs so, those of its takers.
        readers = [each for each in forks.tests if each.partition("::")[0] in READERS]
        readers = [
            each for each in (*readers, *_importers(forks, mutant.path)) if each in known.seconds
        ]
        if not any(here.values()):
            module = ".".join(Path(mutant.path).with_suffix("").parts[1:])
            takers = [
                of
                for file, of in known.lines.items()
                if module in (forks.tree / file).read_text("utf-8")
            ]
            here = {k: names for k, of in enumerate(takers) for names in of.values()}
        at = set().union(*here.values()) - set(readers)
    breadth = Counter(each for names in here.values() for each in names)
    most, place = max(breadth.values(), default=0), Path(mutant.path)
    near = [place.stem.rstrip("s"), place.parent.name]

    def rank(test: str) -> tuple[int, bool, float, str]:
        """Of its module, of its room (many have a `reader.py`), of others; short ones first."""
        file = test.partition("::")[0]
        far = next((k for k, name in enumerate(near) if name in file), len(near))
        seconds = known.seconds.get(test, 0.0)
        return far, bool(readers) and breadth[test] < most / 2, seconds, test

    ranked = [*sorted(dict.fromkeys(readers), key=rank), *sorted(at, key=rank)]
    tests, left_out = _within(ranked, known, OFFERED * most_s)
    files = list(dict.fromkeys(each.partition("::")[0] for each in tests))[:MOST_FILES]
    beside = [
        each
        for file in files
        for each in forks.tests
        if each.partition("::")[0] == file and each not in tests and each in known.seconds
    ]
    pieces = _pieces(tests, forks.tests, known, most_s / PIECES)
    return pieces, _within(beside, known, OFFERED * most_s / 2.0)[0], left_out


def _pieces(
    ranked: Sequence[str], every: Sequence[str], known: Reached, piece_s: float
) -> list[str]:
    """Those tests with each file's together within a piece, in pytest's order there."""
    place = {each: k for k, each in enumerate(every)}
    found: list[str] = []
    left = list(ranked)
    while left:
        piece, _ = _within(left, known, piece_s)
        left = left[len(piece) :]
        files = list(dict.fromkeys(each.partition("::")[0] for each in piece))
        found += sorted(piece, key=lambda e: (files.index(e.partition("::")[0]), place[e]))
    return found


def _importers(forks: Any, path: str) -> list[str]:
    """Tests of the files that import a module by its name."""
    package, _, stem = ".".join(Path(path).with_suffix("").parts[1:]).rpartition(".")
    asked = re.compile(
        rf"\b{re.escape(package)}\.{stem}\b"
        rf"|from {re.escape(package)} import (?:\([^)]*|[^(\n]*)\b{stem}\b"
    )
    files = dict.fromkeys(each.partition("::")[0] for each in forks.tests)
    known = {
        file
        for file in files
        if file.startswith("tests/") and asked.search((forks.tree / file).read_text("utf-8"))
    }
    return [each for each in forks.tests if each.partition("::")[0] in known]


def _within(names: Sequence[str], known: Reached, most_s: float) -> tuple[list[str], int]:
    """The first of those that take so long together, at least one; how many are left out."""
    taken: list[str] = []
    spent = 0.0
    for each in names:
        spent += known.seconds.get(each, 1.0)
        if taken and spent > most_s:
            break
        taken.append(each)
    return taken, len(names) - len(taken)


def share(missed: int, tried: int) -> str:
    """So many of so many in percent, with its interval."""
    from scipy.stats import beta

    low = beta.ppf(0.025, missed, tried - missed + 1) if missed else 0.0
    high = beta.ppf(0.975, missed + 1, tried - missed) if missed < tried else 1.0
    return f"{100 * missed / tried:.1f} % ({100 * low:.1f} to {100 * high:.1f}) of {tried}"


def counts(ends: Sequence[tuple[Mutant, str]], packages: Sequence[str]) -> list[str]:
    """A line of each package, and of all."""
    lines = []
    for package in (*packages, ""):
        found = Counter(
            end for each, end in ends if each.path.startswith(f"src/flightid/{package}")
        )
        tried = found.total()
        missed = sum(found[each] for each in UNNOTICED)
        if tried:
            lines.append(f"{package or 'all'}: unnoticed {share(missed, tried)}; {dict(found)}")
    return lines


def drawn(asked: argparse.Namespace, tree: Path, kept: Sequence[Mapping[str, Any]]) -> list[Mutant]:
    """In the order of chance; or what was not noticed; or all of some files."""
    if asked.again or asked.only:
        wanted = {each["name"] for each in kept if each["end"] in UNNOTICED}
        words = asked.only or sorted({each.partition(": ")[0] for each in wanted})
        paths = [str(p.relative_to(tree)) for p in sorted((tree / "src/flightid").rglob("*.py"))]
        found = [
            each
            for path in paths
            if any(word in path for word in words)
            for each in mutants_of(path, (tree / path).read_text(encoding="utf-8"))
        ]
        return [each for each in found if not asked.again or _change(tree, each)[0] in wanted]
    every = mutants(tree, asked.packages)
    random.Random(asked.seed).shuffle(every)
    return every


def _change(tree: Path, mutant: Mutant) -> tuple[str, str, str]:
    """What a change is called, which holds where lines move, and the texts before and after."""
    text = (tree / mutant.path).read_text(encoding="utf-8")
    new = changed(text, mutant.operator, mutant.occurrence)
    return f"{mutant.path}: {' => '.join(told(text, new))}", text, new


def main() -> None:
    """Try a sample; print what nobody noticed, and the share."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sample", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--packages", nargs="+", default=PACKAGES)
    parser.add_argument(
        "--only", nargs="+", help="all of files whose names hold one of these words"
    )
    parser.add_argument("--again", action="store_true", help="try anew what was not noticed")
    parser.add_argument(
        "--seconds", type=float, default=BUDGET_S, help="processor's, of tests for a mutant"
    )
    parser.add_argument("--tests", nargs="+", default=TESTS)
    parser.add_argument("--keep", type=Path, required=True, help="file of what was found")
    asked = parser.parse_args()
    for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "RAYON_NUM_THREADS"):
        os.environ[threads] = "1"
    from tests.stress.mutant_forks import Forks

    keep = asked.keep.resolve()
    keep.parent.mkdir(parents=True, exist_ok=True)
    kept = [json.loads(line) for line in keep.open()] if keep.exists() else []
    with tempfile.TemporaryDirectory() as folder:
        tree, digest = copied(Path(folder))
        check_equivalent(tree)
        sample = drawn(asked, tree, kept)
        sources = [f"src/flightid/{each}" for each in PACKAGES]
        words = [*asked.tests, *sources, *(f"--ignore-glob=*/{each}*" for each in SLOW)]
        forks = Forks(tree, words, sources)
        known = reached(forks, tree, keep.with_suffix(".reach"))
        had = {each["name"]: each["end"] for each in kept if each["tree"] == digest}
        ends: list[tuple[Mutant, str]] = []
        for mutant in sample:
            if len(ends) == asked.sample and not (asked.again or asked.only):
                break
            start, by = time.monotonic(), ""
            name, text, new = _change(tree, mutant)
            if new == text or (mutant.path, *told(text, new)) in EQUIVALENT:
                continue
            end = had.get(name, "")
            if not end or asked.again:
                end, by = end_of(forks, mutant, text, new, known, asked.seconds)
                record = {"name": name, "end": end, "by": by, "tree": digest}
                record |= {"line": mutant.line, "s": round(time.monotonic() - start, 1)}
                with keep.open("a") as file:
                    file.write(json.dumps(record) + "\n")
            if end == "no change":
                continue
            ends.append((mutant, end))
            if end in UNNOTICED:
                print(f"{len(ends)} {end} {by} :{mutant.line} {name}", flush=True)
        forks.end()
    print("\n".join(counts(ends, asked.packages)))


if __name__ == "__main__":
    main()
