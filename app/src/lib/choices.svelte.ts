import { drafts } from "./drafts";

export const ROLES = ["input", "output", "injected", "time", "left out"] as const;
export type Role = (typeof ROLES)[number];

const isTable = (value: unknown): value is Record<string, unknown> => typeof value === "object" && value !== null && !Array.isArray(value);
const only = <T>(value: unknown, fits: (each: unknown) => each is T): Record<string, T> => (isTable(value) ? Object.fromEntries(Object.entries(value).filter((pair): pair is [string, T] => fits(pair[1]))) : {});
const isRole = (value: unknown): value is Role => ROLES.includes(value as Role);
const isText = (value: unknown): value is string => typeof value === "string";
const isSaid = (value: unknown): value is string => isText(value) && value !== "";
const isNumber = (value: unknown): value is number => typeof value === "number" && Number.isFinite(value);

/**
 * What is chosen of a rig's records before there is a study, which holds it afterwards: the folder
 * keeps it as it keeps what is typed, for another window or a later day.
 */
export class Choices {
  roles = $state<Record<string, Role>>({});
  units = $state<Record<string, string>>({});
  servos = $state<Record<string, number>>({});
  /** Sample time, step of the grid, s, and what inputs do between samples: null is not said. */
  sample = $state<number | null>(null);
  grid = $state<number | null>(null);
  held = $state<string | null>(null);
  /** Spikes to be bridged before structures are tried. */
  bridges = $state.raw<Record<string, unknown>[]>([]);
  template = $state("");
  /** Whether it is from before. */
  again = $state(false);

  constructor(readonly log: string) {
    const kept = drafts.kept(this.#place);
    if (kept) this.#take(kept.text);
    this.again = !this.bare;
  }

  get #place() {
    return `records:${this.log}`;
  }

  get #told() {
    const { roles, units, servos, sample, grid, held, bridges, template } = this;
    return JSON.stringify({ roles, units, servos, sample, grid, held, bridges, template });
  }

  /** Whether nothing is chosen. */
  get bare() {
    const none = (table: object) => !Object.keys(table).length;
    return none(this.roles) && none(this.units) && none(this.servos) && this.sample === null && this.grid === null && this.held === null && !this.bridges.length && !this.template;
  }

  /** A unit of columns; empty: nobody says it. */
  measured(names: string[], unit: string) {
    for (const name of names) {
      if (unit) this.units[name] = unit;
      else delete this.units[name];
    }
  }

  keep() {
    if (this.bare) drafts.drop(this.#place);
    else drafts.keep(this.#place, { text: this.#told, name: "", before: "" });
  }

  /** The study holds it now. */
  written() {
    this.again = false;
    drafts.drop(this.#place);
  }

  /** As the files were first read. */
  discard() {
    this.#take("{}");
    this.written();
  }

  /** Of a file of the folder, that anybody may have written: what does not fit is passed over. */
  #take(text: string) {
    let found: unknown;
    try {
      found = JSON.parse(text);
    } catch {
      return;
    }
    if (!isTable(found)) return;
    this.roles = only(found.roles, isRole);
    this.units = only(found.units, isSaid);
    this.servos = only(found.servos, isNumber);
    this.sample = isNumber(found.sample) ? found.sample : null;
    this.grid = isNumber(found.grid) ? found.grid : null;
    this.held = isText(found.held) ? found.held : null;
    this.bridges = Array.isArray(found.bridges) ? found.bridges.filter(isTable) : [];
    this.template = isText(found.template) ? found.template : "";
  }
}
