import * as api from "./api";
import type { Draft } from "./types";

/** How long a hand rests before what it typed is sent, and how long until it is tried again. */
const REST_MS = 300;
const AGAIN_MS = 3000;
const LOCAL = "flightid-draft:";

/** What the folder is to be told of a place. */
interface Told {
  /** None: what is known was stored, or thrown away. */
  draft: Draft | null;
  known: Draft | null;
  /** Whether it is of this window: else a page before this one has left it. */
  own: boolean;
}
const same = (one: Draft | null | undefined, other: Draft | null | undefined) => JSON.stringify(one) === JSON.stringify(other);

/**
 * What is typed and not stored yet: the folder keeps it until it is, or until it is thrown away. This
 * browser holds what the server has not taken yet, and asks before the page goes where it cannot.
 */
class Drafts {
  #typed: Record<string, Draft> = {};
  /** What this window has typed: another window's text takes its place in the folder alone. */
  #mine: Record<string, Draft> = {};
  /** What the folder has, or had, of the words that this window shows: nothing else is removed by it. */
  #known: Record<string, Draft> = {};
  #unsent = new Map<string, Told>();
  /** What this window has left in the browser's store, which others write to as well. */
  #left: Record<string, string> = {};
  /** Hears where another window's words stay when this one's are stored or thrown away. */
  stays: (place: string) => void = () => {};
  /** Places that nothing but this page knows: the browser's store is full, or shut. */
  #held = new Set<string>();
  /** One address may serve one folder after the other. */
  #folder = "";
  #timer = 0;
  #sends = false;

  constructor() {
    addEventListener("beforeunload", (event) => {
      if (this.#held.size) event.preventDefault();
    });
    // A reload gives this window's own text back, whatever another one has typed or stored.
    addEventListener("pagehide", () => Object.entries(this.#mine).forEach(([place, draft]) => this.#leave(place, { draft, known: null, own: true })));
    // Another window has typed meanwhile.
    addEventListener("focus", () => void this.load());
  }

  /** Take up what the folder has, and what a page before this one could not send. */
  async load() {
    try {
      const told = await api.drafts();
      this.#folder = told.folder;
      this.#typed = Object.fromEntries(told.drafts.map((each) => [each.place, each.draft!]));
    } catch {
      return;
    }
    for (const [place, told] of [...this.#leftHere(), ...this.#unsent]) this.#put(place, told);
  }

  /** What is kept there, for whoever shows it. */
  kept(place: string): Draft | null {
    const kept = this.#typed[place] ?? null;
    if (kept) this.#show(place, kept);
    return kept;
  }

  /** This window shows it: known it is when the folder has it. */
  #show(place: string, draft: Draft) {
    const unsent = this.#unsent.get(place);
    if (unsent) unsent.own = true;
    else this.#known[place] = draft;
  }

  keep(place: string, draft: Draft) {
    this.#mine[place] = draft;
    if (same(draft, this.#typed[place])) this.#show(place, draft);
    else this.#put(place, { draft, known: null, own: true });
  }

  /** What this window shows there is stored, or thrown away; what another one has typed stays. */
  drop(place: string) {
    const known = this.#known[place] ?? null;
    if (same(this.#typed[place], this.#mine[place])) delete this.#typed[place];
    delete this.#mine[place];
    if (known || this.#unsent.get(place)?.draft) this.#put(place, { draft: null, known, own: true });
  }

  #put(place: string, told: Told) {
    if (told.draft) this.#typed[place] = told.draft;
    else if (same(this.#typed[place], told.known)) delete this.#typed[place];
    this.#unsent.set(place, told);
    this.#leave(place, told);
    this.#later(REST_MS);
  }

  #leave(place: string, { draft, known }: Told) {
    try {
      const left = JSON.stringify({ draft, known });
      const there = localStorage.getItem(this.#key(place));
      // A window that was closed has left its own words here, unless these are they.
      const free = !there || there === this.#left[place] || same((JSON.parse(there) as Told).draft, known);
      if (draft || free) localStorage.setItem(this.#key(place), (this.#left[place] = left));
      this.#held.delete(place);
    } catch {
      this.#held.add(place);
    }
  }

  #later(wait: number) {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => void this.#send(), wait) as unknown as number;
  }

  /** One after the other: of two that go at once the older one may come last. */
  async #send() {
    if (this.#sends) return;
    this.#sends = true;
    for (const [place, told] of [...this.#unsent]) {
      let there: Draft | null = null;
      try {
        // What was under way when this one was stored is known by now.
        const known = told.own ? (this.#known[place] ?? null) : told.known;
        there = (await api.keepDraft({ place, draft: told.draft, known: told.draft ? null : known })).draft;
      } catch (problem) {
        if (![413, 422].includes((problem as api.Refusal).status)) break; // nobody answers
        this.#unsent.delete(place); // too long for the server: the browser holds it
        continue;
      }
      if (told.own && told.draft) this.#known[place] = told.draft;
      if (this.#unsent.get(place) !== told) continue;
      this.#sent(place);
      if (!told.draft) this.#removed(place, told, there);
    }
    this.#sends = false;
    if (this.#unsent.size) this.#later(AGAIN_MS);
  }

  #removed(place: string, { own }: Told, there: Draft | null) {
    if (own) delete this.#known[place];
    if (there) this.#typed[place] = there;
    else delete this.#typed[place];
    if (own && there) this.stays(place);
  }

  #sent(place: string) {
    this.#unsent.delete(place);
    this.#held.delete(place);
    try {
      if (localStorage.getItem(this.#key(place)) === this.#left[place]) localStorage.removeItem(this.#key(place));
      delete this.#left[place];
    } catch {
      // nothing was kept
    }
  }

  #key(place: string) {
    return `${LOCAL}${this.#folder}:${place}`;
  }

  #leftHere(): [place: string, told: Told][] {
    const head = this.#key("");
    try {
      const keys = Object.keys(localStorage).filter((each) => each.startsWith(head));
      const left = keys.map((each) => [each.slice(head.length), JSON.parse(localStorage.getItem(each) ?? "null")] as const);
      return left.filter(([, told]) => told).map(([place, { draft, known }]) => [place, { draft, known, own: false }]);
    } catch {
      return [];
    }
  }
}

export const drafts = new Drafts();
