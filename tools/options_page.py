"""Write docs/options.md from the fields of every options dataclass; a test keeps the page in step.

python tools/options_page.py --write
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path

from flightid.control.tuning.requirements import TuningRequirements
from flightid.identification.methods import METHODS
from flightid.identification.prediction.request import Request
from flightid.identification.reduction.rules import ReductionLimits
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.narx.structure import NarxStructure
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.options import Options, options_of
from flightid.responses.options import ResponseOptions

PAGE = Path(__file__).parent.parent / "docs" / "options.md"
HEAD = """# Options

Every option of every method with its default and range, written from the code by
`tools/options_page.py`. The same words are arguments in Python, keys of a study file and, with
dashes, options of the command line; a value outside its range is refused with the range.
"""


def sections() -> dict[str, type[Options]]:
    """Dataclasses by the heading that they stand under."""
    found: dict[str, type[Options]] = {"estimate_response": ResponseOptions}
    for way in METHODS:
        if options_of(way.options):
            found[f"identify, {way.name} (on {way.data})"] = way.options
    return found | {
        "Polynomial structures": PolynomialStructure,
        "Subspace structures": SubspaceStructure,
        "NARX structures": NarxStructure,
        "predict and verify": Request,
        "reduce": ReductionLimits,
        "TuningRequirements": TuningRequirements,
    }


def section(title: str, options: type[Options]) -> str:
    """One dataclass as Markdown."""
    lines = [
        f"## {title}",
        "",
        "| option | default | value | meaning |",
        "| --- | --- | --- | --- |",
    ]
    for each in options_of(options):
        usual = "" if each.default is dataclasses.MISSING else f"`{each.default!r}`"
        # A bar inside a cell would end it.
        cells = (f"`{each.name}`", usual, each.needed, each.doc)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def page() -> str:
    """The whole page."""
    return "\n\n".join([HEAD.rstrip(), *(section(*each) for each in sections().items())]) + "\n"


def main() -> int:
    """Write the page, or say whether it is in step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the page")
    if parser.parse_args().write:
        PAGE.write_text(page(), encoding="utf-8")
        return 0
    in_step = PAGE.read_text(encoding="utf-8") == page()
    print("in step" if in_step else "out of step: run tools/options_page.py --write")
    return 0 if in_step else 1


if __name__ == "__main__":
    sys.exit(main())
