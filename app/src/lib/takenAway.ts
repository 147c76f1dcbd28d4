import type uPlot from "uplot";

/** Take a chart away. What it still had to draw then asks nothing of the component that made it, which is gone. */
export function takenAway(plot: uPlot | null) {
  if (!plot) return;
  for (const name of Object.keys(plot.hooks)) delete plot.hooks[name as keyof uPlot.Hooks.Arrays];
  for (const scale of Object.values(plot.scales)) {
    const ends: uPlot.Range.MinMax = [scale.min ?? null, scale.max ?? null];
    scale.range = () => ends;
  }
  for (const each of plot.axes) each.show = false;
  plot.destroy();
}
