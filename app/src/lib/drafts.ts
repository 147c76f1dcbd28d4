/** What is typed and not stored yet: this browser keeps it until it is, or until it is thrown away. */
export interface Draft {
  text: string;
  /** Name of the file, where that is typed too. */
  name: string;
  /** What stood there when it was begun: another text means that somebody has written since. */
  before: string;
}

const PREFIX = "flightid-draft:";

class Drafts {
  /** What the browser could not keep, its store being full or shut: it asks before the page goes. */
  #held: Record<string, Draft> = {};

  constructor() {
    addEventListener("beforeunload", (event) => {
      if (Object.keys(this.#held).length) event.preventDefault();
    });
  }

  kept(place: string): Draft | null {
    if (this.#held[place]) return this.#held[place];
    try {
      return JSON.parse(localStorage.getItem(PREFIX + place) ?? "null");
    } catch {
      return null;
    }
  }

  keep(place: string, draft: Draft) {
    try {
      localStorage.setItem(PREFIX + place, JSON.stringify(draft));
      delete this.#held[place];
    } catch {
      this.#held[place] = draft;
    }
  }

  /** It is stored, or thrown away. */
  drop(place: string) {
    delete this.#held[place];
    try {
      localStorage.removeItem(PREFIX + place);
    } catch {
      // nothing was kept
    }
  }
}

export const drafts = new Drafts();
