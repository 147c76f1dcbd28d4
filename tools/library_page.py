"""Write docs/library.md from the models of the library; a test keeps the page in step.

python tools/library_page.py --write
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import flightid as fid
from flightid.dynamics import Mode
from flightid.models import Model, StateSpaceModel, load_structure

PAGE = Path(__file__).parent.parent / "docs" / "library.md"
HEAD = """# Library of models

Every model that `fid.library_names()` lists, with its source. This page is written from the models
by `tools/library_page.py`. Load one by its name, and give it the constants of your own vehicle:

```python
import flightid as fid

model = fid.load_model("fixed_wing_lateral").with_fixed(U0=28.0, W0=2.0, theta0=0.07)
print(model)
```

A model written for any axis takes `axis="roll"`, `"pitch"` or `"yaw"`; it is shown here for roll.
"""


def _table(heads: list[str], rows: list[list[str]]) -> list[str]:
    lines = [heads, ["---"] * len(heads), *rows]
    return [f"| {' | '.join(cell.replace('|', '/') for cell in line)} |" for line in lines]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _channels(model: Model) -> list[str]:
    def listed(names: tuple[str, ...]) -> str:
        return ", ".join(f"`{name}` ({model.units[name]})" for name in names)

    lines = [f"Inputs: {listed(model.inputs)}.", f"Outputs: {listed(model.outputs)}."]
    if isinstance(model, StateSpaceModel):
        states = ", ".join(f"`{name}` ({unit})" for name, unit in model.states.items())
        lines.insert(0, f"States: {states}.")
    return ["  \n".join(lines)]


def _mode(mode: Mode) -> str:
    value = mode.root
    if not mode.is_pair:
        return f"{mode.name} {value.real:.4g}"
    place = f"{value.real:.4g} ± {value.imag:.4g}j"
    size, damping = abs(value), -value.real / abs(value)
    return f"{mode.name} {place} (ω = {size:.4g}, ζ = {damping:.3g})"


def _modes(model: Model) -> list[str]:
    if not isinstance(model, StateSpaceModel):
        return []
    return ["", f"Modes, rad/s: {'; '.join(map(_mode, fid.modes(model)))}."]


def section(name: str) -> str:
    """One model as Markdown."""
    model = load_structure(name)
    rows = [
        [f"`{p.name}`", _number(p.value), p.unit, p.tie or ("" if p.free else "fixed"), p.note]
        for p in model.parameters.values()
    ]
    parameters = _table(["parameter", "value", "unit", "", "meaning"], rows)
    equations = [line for line in str(model).splitlines() if not line.startswith("output ")]
    lines = [f"## `{name}`", "", f"{model.name}. {model.note}", "", f"Source: {model.source}.", ""]
    lines += [*_channels(model), "", "```text", *equations, "```", *_modes(model), ""]
    return "\n".join([*lines, *parameters])


def page() -> str:
    """The whole page."""
    return "\n\n".join([HEAD.rstrip(), *map(section, fid.library_names())]) + "\n"


def main() -> int:
    """Write the page, or say whether it is in step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write the page")
    if parser.parse_args().write:
        PAGE.write_text(page(), encoding="utf-8")
        return 0
    in_step = PAGE.read_text(encoding="utf-8") == page()
    print("in step" if in_step else "out of step: run tools/library_page.py --write")
    return 0 if in_step else 1


if __name__ == "__main__":
    sys.exit(main())
