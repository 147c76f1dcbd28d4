import { onDestroy } from "svelte";
import { live } from "./live.svelte";
import type { AxisGains, GainsAnswer, GainsQuestion } from "./types";

/** How long an answer may take before the page says that it is waited for. */
const LATE_MS = 900;
/** Rest of a hand after which time responses follow the margins. */
const REST_MS = 80;

/** A hand on the gains of an axis: margins follow it, time responses follow the margins when it rests. */
export class Hand {
  moved = $state.raw<AxisGains | null>(null);
  values = $state.raw<Record<string, number>>({});
  refused = $state("");
  late = $state(false);
  /** Whether a slider is pressed: what is found anew does not move it under the hand. */
  #pressed = false;
  /** Gains that `moved` is of. */
  #of = $state.raw<Record<string, number>>({});
  #rest = 0;
  #slow = 0;
  /** Counts what takes the place of moved gains: answers to what was asked before come too late. */
  #turn = 0;
  #ask = live.asker<GainsQuestion, GainsAnswer>("gains");

  /** `still` is the axis as its study has it; made with the component whose hand it is. */
  constructor(readonly log: string, readonly still: () => AxisGains | null) {
    onDestroy(() => this.forget());
  }

  /** What is shown of the axis. */
  get shown() {
    const still = this.still();
    return this.moved && this.moved.axis === still?.axis ? this.moved : still;
  }

  /** Every gain of the axis, those that were moved among them. */
  get now(): Record<string, number> {
    return { ...Object.fromEntries((this.still()?.sliders ?? []).map((each) => [each.name, each.value])), ...this.values };
  }

  /** Whether what is shown is of the sliders as they stand. */
  get holds(): boolean {
    const now = this.now;
    return this.moved !== null && this.moved === this.shown && Object.keys(now).every((name) => now[name] === this.#of[name]);
  }

  get pressed() {
    return this.#pressed;
  }

  /** Let go where the study has it, a hand holds nothing: what it kept from gains found anew goes. */
  set pressed(pressed: boolean) {
    this.#pressed = pressed;
    const stands = (this.still()?.sliders ?? []).every((each) => this.values[each.name] === undefined || this.values[each.name] === each.value);
    if (!pressed && stands) this.forget();
  }

  /** Whose axis has numbers of its sliders rather than of the study, and whether of where they stand now. */
  get told(): { axis: string; now: boolean } | null {
    return this.moved !== null && this.moved === this.shown ? { axis: this.moved.axis, now: this.holds } : null;
  }

  /** Gains are there anew: a slider that is pressed, or is ahead of them, stays and is judged beside them. */
  anew(stale: boolean) {
    if ((!this.pressed && !stale) || !Object.keys(this.values).length) return this.forget();
    this.#turn += 1;
    this.move(...(Object.entries(this.values).at(-1)!));
  }

  /** Gains that were found anew take the place of what a hand has moved. */
  forget() {
    this.stop();
    clearTimeout(this.#slow);
    this.#turn += 1;
    this.late = false;
    this.moved = null;
    this.values = {};
    this.refused = "";
  }

  stop() {
    clearTimeout(this.#rest);
  }

  move = (gain: string, value: number) => {
    if (!this.still()) return;
    this.values = { ...this.values, [gain]: value };
    this.stop();
    this.#judge({ ...this.now, [gain]: value }, false);
  };

  #judge(values: Record<string, number>, responses: boolean) {
    const [still, turn] = [this.still()!, this.#turn];
    clearTimeout(this.#slow);
    this.#slow = setTimeout(() => (this.late = true), LATE_MS) as unknown as number;
    this.#ask({ log: this.log, edits: [], axis: still.axis, values, responses }, (answer) => {
      if (turn !== this.#turn) return;
      clearTimeout(this.#slow);
      this.late = false;
      this.refused = answer.error ?? "";
      if (!answer.moved) return;
      this.#of = values;
      const earlier = this.moved?.axis === answer.moved.axis ? this.moved : still;
      this.moved = responses ? answer.moved : { ...answer.moved, curves: answer.moved.is_stable ? (earlier?.curves ?? []) : [] };
      if (!responses) this.#rest = setTimeout(() => this.still()?.axis === answer.moved!.axis && this.#judge(values, true), REST_MS) as unknown as number;
    });
  }
}
