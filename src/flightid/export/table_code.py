"""Tables of a model as C functions (native: `lookup_table.rs`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from flightid.export.names import number_literal
from flightid.models.language.tables import TableFunction

# Cell and the factors of value and slope at its two ends, as `lookup_table.rs` has them.
_BASIS = """\
static int {prefix}_cell(const double points[], int count, double place, int linear, int outside,
                  double basis[4])
{{
    int cell = 0;
    double start, width, t, rest;
    int beyond;
    while (cell < count - 2 && points[cell + 1] <= place) {{
        cell++;
    }}
    start = points[cell];
    width = points[cell + 1] - start;
    t = (place - start) * (1.0 / width);
    beyond = place < start || place > points[cell + 1];
    if (beyond && outside == 2) {{
        t = NAN;
    }}
    if (beyond && outside == 0) {{
        t = place < start ? 0.0 : 1.0;
    }}
    rest = 1.0 - t;
    if (linear) {{
        basis[0] = rest, basis[1] = 0.0, basis[2] = t, basis[3] = 0.0;
    }} else if (beyond && outside == 1) {{
        const int low = place < start;
        basis[0] = low ? 1.0 : 0.0, basis[1] = low ? t * width : 0.0;
        basis[2] = low ? 0.0 : 1.0, basis[3] = low ? 0.0 : (t - 1.0) * width;
    }} else {{
        basis[0] = rest * rest * (1.0 + 2.0 * t), basis[1] = rest * rest * t * width;
        basis[2] = t * t * (3.0 - 2.0 * t), basis[3] = -(t * t * rest * width);
    }}
    return cell;
}}"""

_ONE_AXIS = """\
static double {name}(double first, double second)
{{
{arrays}
    double basis[4];
    const int row = {prefix}_cell(rows, {n}, first, {linear}, {outside}, basis);
    (void)second;
    return basis[0] * value[row] + basis[1] * by_row[row] + basis[2] * value[row + 1]
         + basis[3] * by_row[row + 1];
}}"""

_TWO_AXES = """\
static double {name}(double first, double second)
{{
{arrays}
    double across[4], along[4], sum = 0.0;
    const int row = {prefix}_cell(rows, {n}, first, {linear}, {outside}, across);
    const int column = {prefix}_cell(columns, {k}, second, {linear}, {outside}, along);
    int i, j;
    for (i = 0; i < 2; i++) {{
        for (j = 0; j < 2; j++) {{
            const int place = (row + i) * {k} + column + j;
            const double v = along[2 * j], s = along[2 * j + 1];
            sum += across[2 * i] * (v * value[place] + s * by_column[place])
                 + across[2 * i + 1] * (v * by_row[place] + s * by_both[place]);
        }}
    }}
    return sum;
}}"""
_OUTSIDE = {"hold": 0, "linear": 1, "refuse": 2}


def array_of(name: str, values: Sequence[float]) -> str:
    """A constant array, a few numbers a line."""
    numbers = [number_literal(value) for value in values]
    rows = [", ".join(numbers[i : i + 6]) for i in range(0, len(numbers), 6)]
    listed = ",\n        ".join(rows)
    return f"    static const double {name}[{len(numbers)}] = {{\n        {listed}}};"


def table_functions(tables: Mapping[str, TableFunction], prefix: str) -> list[str]:
    """C functions of the tables, in the order of their names, after what they share.

    Parameters
    ----------
    tables : mapping of str to TableFunction
    prefix : str

    Returns
    -------
    list of str
        The function of the table at place k is called ``<prefix>_table_<k>``.
    """
    if not tables:
        return []
    found = [_BASIS.format(prefix=prefix)]
    # The native half numbers them in the order of a sorted map.
    for place, name in enumerate(sorted(tables)):
        found.append(_function(tables[name], f"{prefix}_table_{place}", prefix))
    return found


def _function(table: TableFunction, name: str, prefix: str) -> str:
    nodes = table.native.nodes()
    arrays = [array_of("rows", table.axes[0].points), array_of("value", nodes[0])]
    arrays.append(array_of("by_row", nodes[1]))
    two = len(table.axes) > 1
    if two:
        arrays.insert(1, array_of("columns", table.axes[1].points))
        arrays += [array_of("by_column", nodes[2]), array_of("by_both", nodes[3])]
    words = {
        "name": name,
        "prefix": prefix,
        "arrays": "\n".join(arrays),
        "n": len(table.axes[0].points),
        "k": len(table.axes[-1].points),
        "linear": int(table.interpolation == "linear"),
        "outside": _OUTSIDE[table.outside],
    }
    return (_TWO_AXES if two else _ONE_AXIS).format(**words)
