"""Write docs/numbers.md from the named numbers of the code; a test keeps the page in step.

python tools/numbers_page.py --write
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "numbers.md"
AREAS = {
    "logs": "Reading logs",
    "inspection": "Inspection",
    "evidence": "Evidence of a fit",
    "uncertainty": "Intervals and tests",
    "control/tuning": "Gains",
}
LONGEST = 160
"""Letters of a number's expression: longer ones are tables of a format, no limits."""
HEAD = """# Named numbers

What decides where nobody is asked: the limits behind lights, warnings, intervals and gains, and the
sizes that computations work with. Written from the code by `tools/numbers_page.py`, in the words
that stand beside each number there; those that you may choose are [Options](options.md).
"""


def numbers(path: Path) -> Iterator[tuple[str, str, str]]:
    """Name, expression and sentence of each number that a module names and explains."""
    text = path.read_text(encoding="utf-8")
    body = ast.parse(text).body
    for each, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(each, ast.Assign):
            (target,), value = each.targets, each.value
        elif isinstance(each, ast.AnnAssign) and each.value:
            target, value = each.target, each.value
        else:
            continue
        if isinstance(value, ast.Call) and ast.unparse(value.func) == "Threshold":
            limit, unit, source = map(ast.unparse, value.args)
            unit = ast.literal_eval(unit)
            yield (
                ast.unparse(target),
                f"{limit} {unit}".removesuffix(" 1"),
                ast.literal_eval(source),
            )
        elif is_number(value):
            # Of numbers alone: a segment splits the whole text.
            told = " ".join((ast.get_source_segment(text, value) or "").split())
            if len(told) > LONGEST:
                continue
            meaning = after.value if isinstance(after, ast.Expr) else None
            if isinstance(meaning, ast.Constant) and isinstance(meaning.value, str):
                names = ast.unparse(target).strip("()")
                yield names, told, " ".join(meaning.value.split())


def is_number(value: ast.expr) -> bool:
    """Whether an expression has a number in it, and no more than numbers do."""
    if isinstance(value, ast.Constant):
        return isinstance(value.value, int | float) and not isinstance(value.value, bool)
    if isinstance(value, ast.UnaryOp):
        return is_number(value.operand)
    if isinstance(value, ast.BinOp):
        return is_number(value.left) or is_number(value.right)
    if isinstance(value, ast.Tuple | ast.List):
        return any(map(is_number, value.elts))
    if isinstance(value, ast.Dict):
        return any(map(is_number, value.values))
    return isinstance(value, ast.Call) and any(map(is_number, value.args))


def section(area: str, title: str, root: Path = ROOT) -> str:
    """The modules of one package as Markdown."""
    lines = [f"## {title}", "", "| number | is | what it is |", "| --- | --- | --- |"]
    folder = root / "src" / "flightid" / area
    for path in sorted(folder.rglob("*.py")):
        module = path.relative_to(folder).with_suffix("").as_posix().replace("/", ".")
        for name, told, meaning in numbers(path):
            cells = (f"`{module}`: {name}", f"`{told}`", meaning)
            lines.append("| " + " | ".join(each.replace("|", "\\|") for each in cells) + " |")
    return "\n".join(lines)


def page(root: Path = ROOT) -> str:
    """The whole page."""
    return "\n\n".join([HEAD.rstrip(), *(section(*each, root) for each in AREAS.items())]) + "\n"


def main() -> int:
    """Write the page, or say whether it is in step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the page")
    if parser.parse_args().write:
        PAGE.write_text(page(), encoding="utf-8")
        return 0
    in_step = PAGE.read_text(encoding="utf-8") == page()
    print("in step" if in_step else "out of step: run tools/numbers_page.py --write")
    return 0 if in_step else 1


if __name__ == "__main__":
    sys.exit(main())
