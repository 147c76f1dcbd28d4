import * as api from "./api";
import type { Draft } from "./types";

/** How long a hand rests before what it typed is sent, and how long until it is tried again. */
const REST_MS = 300;
const AGAIN_MS = 3000;
const LOCAL = "flightid-draft:";

/**
 * What is typed and not stored yet: the folder keeps it until it is, or until it is thrown away. This
 * browser holds what the server has not taken yet, and asks before the page goes where it cannot.
 */
class Drafts {
  #typed: Record<string, Draft> = {};
  /** What this window has typed: another window's text takes its place in the folder alone. */
  #mine: Record<string, Draft> = {};
  #unsent = new Map<string, Draft | null>();
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
    addEventListener("pagehide", () => Object.entries(this.#mine).forEach(([place, draft]) => this.#leave(place, draft)));
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
    for (const [place, draft] of [...this.#leftHere(), ...this.#unsent]) this.#put(place, draft);
  }

  kept(place: string): Draft | null {
    return this.#typed[place] ?? null;
  }

  keep(place: string, draft: Draft) {
    this.#mine[place] = draft;
    if (JSON.stringify(draft) !== JSON.stringify(this.kept(place))) this.#put(place, draft);
  }

  /** It is stored, or thrown away. */
  drop(place: string) {
    delete this.#mine[place];
    if (this.kept(place) || this.#unsent.get(place)) this.#put(place, null);
  }

  #put(place: string, draft: Draft | null) {
    if (draft) this.#typed[place] = draft;
    else delete this.#typed[place];
    this.#unsent.set(place, draft);
    this.#leave(place, draft);
    this.#later(REST_MS);
  }

  #leave(place: string, draft: Draft | null) {
    try {
      localStorage.setItem(this.#key(place), JSON.stringify(draft));
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
    for (const [place, draft] of [...this.#unsent]) {
      try {
        await api.keepDraft({ place, draft });
      } catch (problem) {
        if (![413, 422].includes((problem as api.Refusal).status)) break; // nobody answers
        this.#unsent.delete(place); // too long for the server: the browser holds it
        continue;
      }
      if (this.#unsent.get(place) === draft) this.#sent(place);
    }
    this.#sends = false;
    if (this.#unsent.size) this.#later(AGAIN_MS);
  }

  #sent(place: string) {
    this.#unsent.delete(place);
    this.#held.delete(place);
    try {
      localStorage.removeItem(this.#key(place));
    } catch {
      // nothing was kept
    }
  }

  #key(place: string) {
    return `${LOCAL}${this.#folder}:${place}`;
  }

  #leftHere(): [place: string, draft: Draft | null][] {
    const head = this.#key("");
    try {
      const keys = Object.keys(localStorage).filter((each) => each.startsWith(head));
      return keys.map((each) => [each.slice(head.length), JSON.parse(localStorage.getItem(each) ?? "null")]);
    } catch {
      return [];
    }
  }
}

export const drafts = new Drafts();
