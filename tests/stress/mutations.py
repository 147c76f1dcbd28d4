"""What `tests.stress.mutants` changes: one operator, number or condition of one file at a time.

Left out is what changes no result, by kinds and by places, each with its reason. No more than that:
a mutant that nobody can notice otherwise is a number or a branch that nothing needs.
"""

from __future__ import annotations

import ast
import difflib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType

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
COSTS_ALONE = {
    "strict": "a check of `zip` that only a fault of the caller fails",
    "check_finite": "a check of SciPy that only a fault of the caller fails",
    "overwrite_input": "an array of its own that may be overwritten",
    "overwrite_a": "an array of its own that may be overwritten",
    "overwrite_b": "an array of its own that may be overwritten",
    "maxsize": "the size of a cache",
}
CACHES = ("lru_cache", "cache")
"""Their arguments are sizes of caches."""
LEFT_OPEN = "reshape"
"""A size of -1 is one that NumPy finds itself, as any other negative one is."""
EQUIVALENT: dict[tuple[str, str, str], str] = {
    (
        "src/flightid/control/tuning/tune.py",
        "asked[0].requirements,",
        "asked[ -1].requirements,",
    ): "each axis is judged with its own requirements in their place",
}
"""File, line before and line after: the reason why no result of any use differs."""
FUNCTION = 0x1
"""Code of a function, not of a module or class: `inspect.CO_OPTIMIZED`."""


@dataclass(frozen=True)
class Mutant:
    """One change of one file: what its operator does at the place of that number."""

    path: str
    operator: str
    occurrence: int
    line: int


def mutants(tree: Path, packages: Sequence[str]) -> list[Mutant]:
    """All of those packages, but annotations and `COSTS_ALONE`."""
    paths = sorted(p for each in packages for p in (tree / "src/flightid" / each).rglob("*.py"))
    found: list[Mutant] = []
    for path in paths:
        found += mutants_of(str(path.relative_to(tree)), path.read_text(encoding="utf-8"))
    return found


def mutants_of(path: str, text: str) -> list[Mutant]:
    """Those of one file."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator

    spans = list(_left_out(ast.parse(text)))
    nodes = list(ast_nodes(get_ast(text)))
    found: list[Mutant] = []
    for name in OPERATORS:
        operator = get_operator(f"core/{name}")()
        places = [at for node in nodes for at in operator.mutation_positions(node)]
        found += [
            Mutant(path, name, occurrence, start[0])
            for occurrence, (start, _) in enumerate(places)
            if not any(low <= start < high for low, high in spans)
        ]
    return found


def check_equivalent(tree: Path) -> None:
    """Refuse a list of places that are not there any more."""
    stale = [
        (path, before)
        for path, before, _ in EQUIVALENT
        if before not in " ".join((tree / path).read_text(encoding="utf-8").split())
    ]
    if stale:
        raise SystemExit(f"EQUIVALENT names lines that are not there any more: {stale}")


def changed(text: str, operator: str, occurrence: int) -> str:
    """The file's text with that change."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    return mutate_code(text, get_operator(f"core/{operator}")(), occurrence) or text


def told(text: str, new: str) -> tuple[str, str]:
    """The lines that differ, before and after, without their indents."""
    old, now = text.splitlines(), new.splitlines()
    k = next((k for k, (a, b) in enumerate(zip(old, now, strict=False)) if a != b), 0)
    last = next((j for j in range(1, len(old)) if old[-j] != now[-j]), 1)
    before, after = (" ".join(" ".join(e[k : len(e) - last + 1]).split()) for e in (old, now))
    return before, after


def _left_out(module: ast.Module) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Where what is not changed begins and ends, line and column.

    Annotations run nowhere, and `COSTS_ALONE` change no number: but `strict=False`, which an honest
    caller would meet.
    """
    for node in ast.walk(module):
        parts = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        if isinstance(node, ast.Call):
            parts += [
                each.value
                for each in node.keywords
                if each.arg in COSTS_ALONE
                and not (each.arg == "strict" and ast.unparse(each.value) == "False")
            ]
            parts += node.args if getattr(node.func, "id", "") in CACHES else []
            if getattr(node.func, "attr", "") == LEFT_OPEN:
                parts += [each for each in node.args if ast.unparse(each) == "-1"]
        for told in parts:
            if isinstance(told, ast.expr) and told.end_lineno and told.end_col_offset:
                yield (told.lineno, told.col_offset), (told.end_lineno, told.end_col_offset)


def statement(text: str, line: int) -> range:
    """The lines of the innermost statement there: of one that holds others, its head."""
    best = range(line, line + 1)
    size = len(text)
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or 0):
            body = getattr(node, "body", None) or getattr(node, "cases", None)
            last = node.end_lineno or line
            if body:
                first = body[0]
                start = getattr(first, "lineno", None) or first.pattern.lineno
                last = max(node.lineno, start - 1)
            if node.lineno <= line <= last and last - node.lineno < size:
                best, size = range(node.lineno, last + 1), last - node.lineno
    return best


def functions_changed(old: CodeType, new: CodeType) -> list[tuple[CodeType, CodeType]] | None:
    """Outermost functions that differ, of two files' code; None where what runs on import does."""
    found: list[tuple[CodeType, CodeType]] = []

    def alike(a: CodeType, b: CodeType) -> bool:
        if a == b:
            return True
        if a.co_flags & FUNCTION:
            found.append((a, b))
            return True
        inner = [[c for c in each.co_consts if isinstance(c, CodeType)] for each in (a, b)]
        plain = [[repr(c) for c in e.co_consts if not isinstance(c, CodeType)] for e in (a, b)]
        same = a.co_code == b.co_code and a.co_names == b.co_names and plain[0] == plain[1]
        return same and len(inner[0]) == len(inner[1]) and all(map(alike, *inner))

    return found if alike(old, new) else None


def moved(old: str, new: str) -> dict[int, int]:
    """Lines of a text that stand in another: their numbers there."""
    blocks = difflib.SequenceMatcher(None, old.splitlines(), new.splitlines(), autojunk=False)
    return {
        block.a + k + 1: block.b + k + 1
        for block in blocks.get_matching_blocks()
        for k in range(block.size)
    }
