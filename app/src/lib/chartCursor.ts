import type uPlot from "uplot";

/** Shift with an arrow moves the cursor by a hundredth of the plot; true where that was the key. */
export function cursorMoved(event: KeyboardEvent, plot: uPlot): boolean {
  if (!event.shiftKey || !/^Arrow(Left|Right)$/.test(event.key)) return false;
  event.preventDefault();
  const room = plot.over.clientWidth;
  const from = (plot.cursor.left ?? -1) < 0 ? room / 2 : plot.cursor.left! + (event.key === "ArrowLeft" ? -room : room) / 100;
  // The third, which its types lack, tells the other charts of the clock.
  (plot.setCursor as (at: { left: number; top: number }, fire: boolean, tell: boolean) => void)({ left: Math.min(room - 1, Math.max(0, from)), top: plot.over.clientHeight / 2 }, true, true);
  return true;
}

/** Values under the cursor, or nothing where it is not on the plot. */
export function valuesRead(plot: uPlot, names: (string | null)[], units: string[], at: (x: number) => string): string {
  const k = plot.cursor.idx;
  if (k == null || (plot.cursor.left ?? -1) < 0) return "";
  const several = names.filter((each) => each !== null).length > 1;
  const values = names.flatMap((name, row) => {
    const value = plot.data[row + 1]?.[k];
    return name === null ? [] : [`${several ? `${name} ` : ""}${value == null ? "–" : `${Number(value.toPrecision(5))}${units[row] ? ` ${units[row]}` : ""}`}`];
  });
  return `${at(plot.data[0][k])}: ${values.join(", ")}`;
}

/** What a drag over a plot has marked, and the mark taken away; null where it was a click. */
export function dragged(plot: uPlot): [number, number] | null {
  if (plot.select.width < 3) return null;
  const span: [number, number] = [plot.posToVal(plot.select.left, "x"), plot.posToVal(plot.select.left + plot.select.width, "x")];
  plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  return span;
}
