"""Change one operator or number at a time and see whether a test fails.

`python -m tests.stress.mutants --sample 200 --keep FILE`, with the extra `mutants`: `make mutants`.

Drawn by chance from all mutants of the packages that tell users what to believe, with annotations
left out, and what alters no result: sizes of caches, arrays that may be overwritten, checks that a
caller would have to fail (`strict` of zip). Each meets the tests that reach its line, by a run with
coverage that comes first and is kept by groups of files, and the examples of its file; what runs on
import alone also the contract of classes, which reads the source. Then, where none of them notices,
the other tests of their files, which may take what a fixture made of that line for another. The
tree is a copy. A mutant that no test notices is printed with its line: mend the test, or argue that
the line does the same without it. Kept mutants are not tried again. The share is told by package,
each with the interval of Clopper and Pearson, *Biometrika* 26 (1934), 404-413.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from scipy.stats import beta

ROOT = Path(__file__).parents[2]
PACKAGES = ("logs", "inspection", "evidence", "uncertainty", "control/tuning")
TESTS = ("tests/unit", "tests/truth", "tests/contract")
SLOW = ("test_app_", "test_fleet_")  # they try other packages, in processes of their own
OPERATORS = (
    *("NumberReplacer", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue"),
    *("ReplaceAndWithOr", "ReplaceOrWithAnd", "AddNot", "ReplaceUnaryOperator_Delete_Not"),
    *("ReplaceBinaryOperator_Add_Sub", "ReplaceBinaryOperator_Sub_Add"),
    *("ReplaceBinaryOperator_Mul_Div", "ReplaceBinaryOperator_Div_Mul"),
    *("ReplaceComparisonOperator_Lt_LtE", "ReplaceComparisonOperator_LtE_Gt"),
    *("ReplaceComparisonOperator_Gt_LtE", "ReplaceComparisonOperator_GtE_Lt"),
    *("ReplaceComparisonOperator_Eq_NotEq", "ReplaceComparisonOperator_NotEq_Eq"),
    *("ReplaceUnaryOperator_USub_UAdd", "ReplaceBreakWithContinue", "ZeroIterationForLoop"),
)
CONTRACTS = ("tests/contract/test_array_classes.py",)
"""They read the source of classes: no line of it is run by them."""
COSTS_ALONE = ("strict", "overwrite_input", "overwrite_a", "overwrite_b", "check_finite", "maxsize")
"""Arguments that no result depends on: they refuse, keep or overwrite."""
CACHES = ("lru_cache", "cache")
MOST_TESTS, MOST_FILES, LONGEST_S = 60, 3, 150
FILES_AT_ONCE = 24
"""Test files of one run with coverage: what is lost where it is stopped."""
WAITING = 10
"""Wall time a processor's second may take: a busy machine is not a loop without end."""
PASSED, MISUSED, NO_TESTS = 0, 4, 5
ENDS = {PASSED: "survived", 1: "killed", 2: "killed"}
"""By pytest's code: 1, a test failed; 2, the tree cannot be imported."""
UNNOTICED = ("survived", "not reached", "not run", "too long")
Reached = Mapping[str, Mapping[int, Sequence[str]]]


@dataclass(frozen=True)
class Mutant:
    """One change of one file."""

    path: str
    operator: str
    occurrence: int
    line: int

    @property
    def name(self) -> str:
        """The file, its line and what is done there."""
        return f"{self.path}:{self.line} {self.operator} {self.occurrence}"


def copied(folder: Path) -> Path:
    """The tracked files and what was built in place, where mutants harm nobody."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True)
    native = [str(each.relative_to(ROOT)) for each in (ROOT / "src/flightid").glob("_native*.so")]
    for name in [*filter(None, listed.stdout.decode().split("\0")), *native]:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    return folder


def tested(tree: Path, words: Sequence[str], longest_s: int | None, told: list[str]) -> int | None:
    """How pytest ends in that tree; below zero or None where its processor's time is not enough."""
    first = (str(tree), str(tree / "src"), *filter(None, [os.environ.get("PYTHONPATH")]))
    given = os.environ | {"PYTHONPATH": os.pathsep.join(first)}
    limit = partial(resource.setrlimit, resource.RLIMIT_CPU, (longest_s, longest_s))
    for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "RAYON_NUM_THREADS"):
        given[threads] = "1"
    try:
        ended = subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "--no-header", "--tb=no", "-rfE", *words],
            cwd=tree, env=given, timeout=longest_s and WAITING * longest_s, check=False, text=True,
            preexec_fn=limit if longest_s else None,
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return None
    told += re.findall(r"^(?:FAILED|ERROR) (\S+::.+?)(?: - .*)?$", ended.stdout, re.MULTILINE)
    return ended.returncode


def reached(
    tree: Path, kept: Path, packages: Sequence[str], tests: Sequence[str], workers: int
) -> Reached:
    """Tests by file and line that they run; made once, for minutes, and read from `kept` again."""
    from coverage import CoverageData

    kept.mkdir(parents=True, exist_ok=True)
    files = [
        str(path.relative_to(tree))
        for each in tests
        for path in sorted(
            (tree / each).rglob("test_*.py") if each[-3:] != ".py" else [tree / each]
        )
        if not path.name.startswith(SLOW)
    ]
    found: dict[str, dict[int, set[str]]] = {}
    for start in range(0, len(files), FILES_AT_ONCE):
        data = kept / f"{start:04d}"
        if not data.exists():
            _cover(tree, data, packages, files[start : start + FILES_AT_ONCE], workers)
            print(f"{min(start + FILES_AT_ONCE, len(files))}/{len(files)} test files", flush=True)
        known = CoverageData(str(data))
        known.read()
        for file in known.measured_files():
            lines = found.setdefault(str(Path(file)), {})
            for line, names in known.contexts_by_lineno(file).items():
                # Names of examples hold bars of their own: the last one is the coverage's.
                lines.setdefault(line, set()).update(each.rpartition("|")[0] for each in names)
    return {
        file: {line: sorted(names - {""}) for line, names in lines.items()}
        for file, lines in found.items()
    }


def _cover(
    tree: Path, data: Path, packages: Sequence[str], files: Sequence[str], workers: int
) -> None:
    """Run those test files with coverage; those that fail would notice everything: left out."""
    settings = tree / "coverage.rc"
    sources = "\n    ".join(str(tree / "src/flightid" / each) for each in packages)
    settings.write_text(f"[run]\nrelative_files = true\nsource =\n    {sources}\n")
    words = ["--cov", f"--cov-config={settings}", "--cov-context=test", "--cov-report="]
    failed: list[str] = []
    while True:
        left_out = [f"--deselect={each}" for each in failed]
        before = len(failed)
        code = tested(tree, [*words, f"-n{workers}", *left_out, *files], None, failed)
        if code in (PASSED, NO_TESTS):
            break
        if len(failed) == before:
            raise SystemExit(f"pytest ends with {code} before anything is changed: {files}")
        print(f"fail unchanged, left out: {failed[before:]}", flush=True)
    shutil.copy(tree / ".coverage", data)


def mutants(tree: Path, packages: Sequence[str]) -> Iterator[Mutant]:
    """All of those packages, but those of annotations and of what alters no result."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator

    for path in sorted(
        p for each in packages for p in (tree / "src/flightid" / each).rglob("*.py")
    ):
        text = path.read_text(encoding="utf-8")
        spans = list(_left_out(ast.parse(text)))
        nodes = list(ast_nodes(get_ast(text)))
        for name in OPERATORS:
            operator = get_operator(f"core/{name}")()
            places = [at for node in nodes for at in operator.mutation_positions(node)]
            for occurrence, (start, _) in enumerate(places):
                if not any(low <= start < high for low, high in spans):
                    yield Mutant(str(path.relative_to(tree)), name, occurrence, start[0])


def _left_out(module: ast.Module) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Where what is not changed begins and ends, line and column.

    `|` between types runs nowhere, and `COSTS_ALONE` change no number.
    """
    for node in ast.walk(module):
        parts = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        if isinstance(node, ast.Call):
            parts += [each.value for each in node.keywords if each.arg in COSTS_ALONE]
            parts += node.args if getattr(node.func, "id", "") in CACHES else []
        for told in parts:
            if isinstance(told, ast.expr) and told.end_lineno and told.end_col_offset:
                yield (told.lineno, told.col_offset), (told.end_lineno, told.end_col_offset)


def end_of(tree: Path, mutant: Mutant, names: Reached) -> str:
    """Killed, endless, survived, not reached by any test, or such that those are not found."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    tests = near(tree, mutant, names)
    place = tree / mutant.path
    text = place.read_text(encoding="utf-8")
    changed = mutate_code(text, get_operator(f"core/{mutant.operator}")(), mutant.occurrence)
    if changed is None or changed == text:
        return "no change"
    files = list(dict.fromkeys(each.partition("::")[0] for each in tests))[:MOST_FILES]
    examples = ["--doctest-modules", mutant.path]
    if not names.get(mutant.path, {}).get(mutant.line):
        examples += CONTRACTS
    for words in ([*tests[:MOST_TESTS], *examples], *([each] for each in files)):
        try:
            place.write_text(changed, encoding="utf-8")
            code = tested(tree, ["-x", *words], LONGEST_S, [])
        finally:
            place.write_text(text, encoding="utf-8")
        if code is None or code not in (*ENDS, NO_TESTS):
            # No end in time, or names that are not found since a file of tests cannot be imported.
            unchanged = tested(tree, ["-x", *words], LONGEST_S // 2, [])
            ended, left = ("killed", "not run") if code == MISUSED else ("endless", "too long")
            return ended if unchanged == PASSED else left
        if code not in (PASSED, NO_TESTS):
            return ENDS[code]
    return ENDS[PASSED] if tests else "not reached"


def near(tree: Path, mutant: Mutant, names: Reached) -> list[str]:
    """Tests that reach a mutant's line: those of its module first, then those that reach little."""
    lines = [names.get(mutant.path, {})]
    # What runs on import belongs to no test: those of the whole file stand for it, and where all
    # of the file runs so, those of the files that take from it.
    if not any(lines[0].values()):
        module = ".".join(Path(mutant.path).with_suffix("").parts[1:])
        lines = [of for file, of in names.items() if module in (tree / file).read_text("utf-8")]
    breadth = Counter(each for of in lines for found in of.values() for each in found)
    stem = Path(mutant.path).stem.rstrip("s")
    tests = names.get(mutant.path, {}).get(mutant.line) or breadth
    return sorted(tests, key=lambda each: (stem not in each, breadth[each], each))


def share(missed: int, tried: int) -> str:
    """So many of so many in percent, with its interval."""
    low = beta.ppf(0.025, missed, tried - missed + 1) if missed else 0.0
    high = beta.ppf(0.975, missed + 1, tried - missed) if missed < tried else 1.0
    return f"{100 * missed / tried:.1f} % ({100 * low:.1f} to {100 * high:.1f}) of {tried}"


def counts(drawn: Sequence[Mutant], ends: Mapping[str, str], packages: Sequence[str]) -> list[str]:
    """A line of each package, and of all."""
    lines = []
    for package in (*packages, ""):
        found = Counter(
            ends[each.name] for each in drawn if each.path.startswith(f"src/flightid/{package}")
        )
        tried = found.total() - found["no change"]
        missed = sum(found[each] for each in UNNOTICED)
        if tried:
            lines.append(f"{package or 'all'}: unnoticed {share(missed, tried)}; {dict(found)}")
    return lines


def main() -> None:
    """Try a sample; print what nobody noticed, and the share."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sample", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--packages", nargs="+", default=PACKAGES)
    parser.add_argument("--tests", nargs="+", default=TESTS)
    parser.add_argument("--workers", type=int, default=2, help="of the run with coverage")
    parser.add_argument("--keep", type=Path, required=True, help="file of what was found")
    asked = parser.parse_args()
    kept = [json.loads(line) for line in asked.keep.open()] if asked.keep.exists() else []
    ends = {each["name"]: each["end"] for each in kept}
    asked.keep.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        tree = copied(Path(folder))
        kept_lines = asked.keep.with_suffix(".coverage")
        names = reached(tree, kept_lines, asked.packages, asked.tests, asked.workers)
        drawn = random.Random(asked.seed).sample(list(mutants(tree, asked.packages)), asked.sample)
        for k, mutant in enumerate(drawn):
            if mutant.name not in ends:
                ends[mutant.name] = end_of(tree, mutant, names)
                with asked.keep.open("a") as file:
                    found = {"name": mutant.name, "end": ends[mutant.name], **asdict(mutant)}
                    file.write(json.dumps(found) + "\n")
            if ends[mutant.name] in UNNOTICED:
                print(f"{k + 1}/{asked.sample} {ends[mutant.name]}: {mutant.name}", flush=True)
    print("\n".join(counts(drawn, ends, asked.packages)))


if __name__ == "__main__":
    main()
