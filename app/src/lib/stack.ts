/** Of a layout, what is read and changed here: axes, notes, pictures and the legend. */
type Layout = Record<string, any>;
/** Room between two panels, px: the title of an axis and its numbers. */
const BETWEEN_PX = 80;

/**
 * Panels that lie side by side come one below another, column after column, as a phone has room for.
 *
 * Changes the layout of a picture, and says whether it did; `height_px` is that of the picture where
 * its layout names none.
 */
export function stack(layout: Layout, height_px: number): boolean {
  const axes = (letter: string) => Object.entries(layout).filter(([name]) => new RegExp(`^${letter}axis\\d*$`).test(name))
    .map(([name, axis]) => ({ id: name.replace("axis", ""), axis, domain: (axis.domain ?? [0, 1]) as [number, number] }));
  const across = axes("x"), up = axes("y");
  type Axis = (typeof up)[number];
  const sides = new Map(across.map(({ domain }) => [domain[0].toFixed(3), domain]));
  const columns = [...sides.values()].sort((a, b) => a[0] - b[0]);
  if (columns.length < 2) return false;
  const column = (x: number) => Math.max(0, columns.filter(([from]) => from <= x + 1e-3).length - 1);
  const frame = (layout.margin?.t ?? 0) + (layout.margin?.b ?? 0);
  const panel = (layout.height ?? height_px) - frame;
  const beside = ({ axis }: Axis) => across.find(({ id }) => id === (axis.anchor ?? "x"));
  const places = up.map((one) => column(beside(one)?.domain[0] ?? 0));
  // A column may have fewer panels than the first: it ends where its last one does.
  const ends = columns.map((_, place) => Math.min(...up.filter((one, k) =>
    places[k] === place && one.axis.visible !== false).map(({ domain }) => domain[0]), 1));
  const heights = ends.map((end) => (1 - end) * panel);
  const below = (place: number) => heights.slice(place + 1).reduce((sum, height) => sum + height + BETWEEN_PX, 0);
  const inner = below(-1) - BETWEEN_PX;
  const lower = (y: number, place: number) => Math.max(0, below(place) + (y - ends[place]) * panel) / inner;
  up.forEach(({ axis, domain }, k) => {
    const level = up.filter((one) => one.domain[0] === domain[0]);
    const first = level.find((one) => one.axis.title?.text) ?? level[0];
    // Where one title serves a whole line of panels, each gets it; a panel's own title stays its own.
    if (places[k] && !axis.title?.text) { axis.title = first.axis.title; axis.showticklabels = first.axis.showticklabels; }
    axis.domain = domain.map((y) => lower(y, places[k]));
  });
  for (const note of [...layout.annotations ?? [], ...layout.images ?? []]) {
    if (note.xref !== "paper" || note.yref !== "paper") continue;
    const place = column(note.x), [from, to] = columns[place];
    note.x = (note.x - from) / (to - from);
    note.y = lower(note.y, place);
  }
  across.forEach(({ axis }) => { axis.domain = [0, 1]; });
  if (layout.legend?.y > 1) layout.legend.y = 1 + (layout.legend.y - 1) * panel / inner;
  layout.height = inner + frame;
  return true;
}
