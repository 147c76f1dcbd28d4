import { flushSync } from "svelte";
import uPlot from "uplot";

/** Width of what a sheet shows, A4 upright within usual margins, CSS px. */
const SHEET_PX = 700;

/** Light or dark: what was chosen, else what the system says. */
class Look {
  theme: "light" | "dark" = $state("light");

  constructor() {
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const kept = () => localStorage.getItem("flightid-theme");
    const apply = () => this.#apply((kept() ?? (dark.matches ? "dark" : "light")) as "light" | "dark");
    dark.addEventListener("change", apply);
    apply();
    // Paper is white, and what is drawn is as wide as it was on the screen: all of it is made smaller.
    addEventListener("beforeprint", () => {
      const width = document.querySelector("main")?.offsetWidth ?? SHEET_PX;
      const style = document.documentElement.style;
      style.setProperty("--drawn", `${width}px`);
      style.setProperty("--shrunk", String(Math.min(1, SHEET_PX / width)));
      flushSync(() => this.#apply("light"));
    });
    addEventListener("afterprint", apply);
  }

  toggle() {
    const other = this.theme === "dark" ? "light" : "dark";
    localStorage.setItem("flightid-theme", other);
    this.#apply(other);
  }

  #apply(theme: "light" | "dark") {
    document.documentElement.dataset.theme = theme;
    this.theme = theme;
  }
}

export const look = new Look();
export const colour = (name: string) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
export const SERIES = ["c0", "c1", "c2", "c3", "c4", "c5"];
const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";

/** Numbers of an axis with the digits that their step has: a delay of 12 ms was .01 at every tick. */
const ticked = (_: uPlot, ticks: (number | null)[], __: number, ___: number, step: number) => {
  const digits = Math.min(12, Math.max(0, Math.ceil(-Math.log10(step || 1)) + 1));
  return ticks.map((each) => (each === null ? "" : String(Number(each.toFixed(digits)))));
};

/** An axis in the colours of the page. */
export const axis = (more: uPlot.Axis = {}): uPlot.Axis => ({
  stroke: colour("soft"),
  font: FONT,
  labelFont: FONT,
  labelSize: 16,
  labelGap: 2,
  grid: { stroke: colour("grid"), width: 1 },
  ticks: { stroke: colour("grid"), width: 1, size: 4 },
  values: ticked,
  ...more,
});

/** Numbers of the server as uPlot wants them: null breaks a line, undefined lets it go on. */
export const plotted = (row: Float64Array): (number | null | undefined)[] =>
  Array.from(row, (each) => (Number.isNaN(each) ? null : each === Infinity ? undefined : each));

export const three = (value: number) => String(Number(value.toPrecision(3)));
export const seconds = (value: number) => `${Number(value.toFixed(1))} s`;
