/** Keys of every plot: plus and minus about the middle, arrows along, 0 back to the whole. */
export const KEYS = "Plus and minus zoom, arrows move along, 0 shows all";

const STEPS: Record<string, [number, number]> = { "+": [0.7, 0], "=": [0.7, 0], "-": [1 / 0.7, 0], ArrowLeft: [1, -0.15], ArrowRight: [1, 0.15] };

/** The part of an axis that is seen after a key, "whole", or null where the key is none of these. */
export function zoomed(event: KeyboardEvent, [low, high]: [number, number]): [number, number] | "whole" | null {
  if (event.ctrlKey || event.metaKey || event.altKey) return null;
  if (event.key === "0") return "whole";
  const step = STEPS[event.key];
  if (!step) return null;
  const middle = (low + high) / 2 + step[1] * (high - low);
  const half = ((high - low) / 2) * step[0];
  return [middle - half, middle + half];
}

/** A span moved or cut until it lies inside the whole; null where it is all of it. */
export function within([low, high]: [number, number], [first, last]: [number, number]): [number, number] | null {
  const length = high - low;
  if (length >= (last - first) * (1 - 1e-9)) return null;
  const from = Math.min(Math.max(low, first), last - length);
  return [from, from + length];
}
