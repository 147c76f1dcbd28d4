/** Numbers that are typed and belong together: one, or two of which the first lies below the second. */
export interface Rule {
  /** How each is called in a sentence. */
  names: string[];
  /** As they stand, in the unit that is shown; null where nothing is said. */
  values: (number | null)[];
  /** What each may be, both ends taken in. */
  ranges: [number, number][];
  /** What counts where nothing is said; without it a number may be missing. */
  usual?: (number | null)[];
  /** Whether a field may be emptied. */
  empty?: boolean;
  /** Whether the lower end itself is none: what has to be above 0. */
  above?: boolean;
  whole?: boolean;
  unit?: string;
  /** As it is printed in the field and in sentences. */
  print?: (value: number) => string;
}
/** What was typed in each field and does not count yet; null: nothing. */
export type Texts = (string | null)[];
export interface Verdict {
  /** Fields that hold no such number. */
  wrong: boolean[];
  why: string;
  /** What all fields say together, where they may say it. */
  values: (number | null)[];
}

const printed = (rule: Rule, value: number) => (rule.print ?? String)(value);

/** The range in words. */
function allowed(rule: Rule, k: number): string {
  const [least, most] = rule.ranges[k];
  const unit = rule.unit ? ` ${rule.unit}` : "";
  const whole = rule.whole ? "a whole number" : "a number";
  const first = rule.whole ? "a whole number, " : "";
  if (Number.isFinite(least) && Number.isFinite(most)) return `${first}${rule.above ? "above " : ""}${printed(rule, least)} ${rule.above ? "and at most" : "to"} ${printed(rule, most)}${unit}`;
  if (Number.isFinite(least)) return `${first}${rule.above ? "above" : "at least"} ${printed(rule, least)}${unit}`;
  return Number.isFinite(most) ? `at most ${printed(rule, most)}${unit}` : whole;
}

/** What stands meanwhile. */
function standing(rule: Rule): string {
  const now = rule.values.map((each, k) => each ?? rule.usual?.[k] ?? null);
  const said = now.filter((each) => each !== null).map((each) => printed(rule, each));
  const unit = rule.unit ? ` ${rule.unit}` : "";
  return said.length ? `${said.join(" to ")}${unit} stands` : "none stands";
}

/** One number by its text: null where it is left out, undefined where it is none of the range. */
function numberOf(rule: Rule, k: number, text: string): number | null | undefined {
  if (text.trim() === "") return rule.empty ? null : undefined;
  const value = Number(text);
  const [least, most] = rule.ranges[k];
  // The ends as they are printed are taken as the ends.
  const inside = value >= Math.min(least, Number(printed(rule, least))) && value <= Math.max(most, Number(printed(rule, most)));
  if (!inside || (rule.above && value <= least) || (rule.whole && !Number.isInteger(value))) return undefined;
  return Math.min(most, Math.max(least, value));
}

/** Whether what stands in the fields counts, together; else why not. */
export function judged(rule: Rule, texts: Texts): Verdict {
  const now = rule.names.map((_, k) => (texts[k] === null || texts[k] === undefined ? rule.values[k] : numberOf(rule, k, texts[k])));
  const counted = now.map((each, k) => each ?? rule.usual?.[k] ?? null);
  const wrong = now.map((each) => each === undefined);
  const values = now.map((each, k) => (each === null && texts[k] === null ? counted[k] : (each ?? null)));
  if (wrong.some(Boolean)) {
    const said = rule.names.flatMap((name, k) => (wrong[k] ? [`${name} ${texts[k]?.trim() ? "may" : "cannot be left out, and may"} be ${allowed(rule, k)}`] : []));
    return { wrong, why: `${said.join("; ")}; ${standing(rule)}.`, values };
  }
  const [low, high] = counted;
  if (counted.length === 2 && low !== null && high !== null && low >= high) {
    const [first, second] = rule.names;
    const unsaid = rule.names.filter((_, k) => now[k] === null);
    const missing = unsaid.length ? ` (${unsaid.map((each) => `${each}, where nothing is typed: ${printed(rule, each === first ? low : high)}`).join("; ")})` : "";
    return { wrong: texts.map((each) => each !== null), why: `${first} has to be below ${second}${missing}${rule.ranges[0].some(Number.isFinite) ? `, and each ${allowed(rule, 0)}` : ""}; ${standing(rule)}.`, values };
  }
  return { wrong, why: "", values };
}

/**
 * The hand on such numbers: what is refused stays in its field with its reason, and nobody hears of it.
 * Fields are taken together: while one is refused, none counts.
 */
export class Typed {
  texts = $state.raw<Texts>([]);
  /** Why a number inside its range was not stored. */
  #unstored = $state("");
  #storing = false;

  /** `take` hears numbers that may stand; what it gives back tells why they were not stored, or nothing. */
  constructor(readonly rule: () => Rule, readonly take: (values: (number | null)[]) => unknown) {}

  get #all(): Texts {
    return this.rule().names.map((_, k) => this.texts[k] ?? null);
  }

  get verdict(): Verdict {
    return judged(this.rule(), this.#all);
  }

  get why(): string {
    return this.verdict.why || this.#unstored;
  }

  wrong(k: number): boolean {
    return this.verdict.wrong[k] || (this.#unstored !== "" && this.#all[k] !== null);
  }

  text(k: number): string {
    const { values, print } = this.rule();
    return this.#all[k] ?? (values[k] === null || values[k] === undefined ? "" : (print ?? String)(values[k]));
  }

  async type(k: number, text: string) {
    const now = this.#all.with(k, text);
    this.texts = now;
    this.#unstored = "";
    const { why, values } = this.verdict;
    if (why) return;
    this.#storing = true;
    const said = await this.take(values);
    if (this.texts !== now) return; // typed on
    this.#storing = false;
    if (typeof said === "string" && said !== "") this.#unstored = said;
    else this.forget();
  }

  /** Numbers came anew (a drag, Undo, another window): they take the place of what was refused. */
  came() {
    if (!this.#storing) this.forget();
  }

  /** What stands is shown again. */
  forget() {
    this.#storing = false;
    this.texts = [];
    this.#unstored = "";
  }
}
