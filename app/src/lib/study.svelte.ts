import * as api from "./api";
import type { Edit, StudyText } from "./types";

export interface ModelTable {
  name: string;
  axis?: string;
  identify: string[] | string;
  verify?: string[];
  band_rad_s?: [number, number];
  response?: Record<string, unknown>;
}

/** Edits that wait for their turn; whoever changes the same keys meanwhile puts newer values in. */
interface Waiting {
  edits: Edit[];
  stored: Promise<boolean>;
}
/** What a change names where there is no study yet: of a log it begins one. */
const UNWRITTEN = '""';
const keysOf = (edits: Edit[]) => JSON.stringify(edits.map((each) => each.path));

/** The study file of a log: every click of the page changes it here, and nowhere else. */
export class Study {
  file: StudyText | null = $state(null);
  error = $state("");
  conflict: { mine: Edit[]; text: string; etag: string } | null = $state(null);
  changed: string[] = $state([]);
  /** Whether the server was asked once: before that nobody knows whether there is a study. */
  known = $state(false);
  /** Requests that wait or are under way; each begins when the one before it has ended. */
  pending = $state(0);
  #turn: Promise<unknown> = Promise.resolve();
  #waiting: Waiting | null = null;
  constructor(readonly log: string) {}

  get models(): ModelTable[] {
    return (this.file?.settings.model as ModelTable[]) ?? [];
  }

  get segments(): { name: string; span_s?: [number, number] }[] {
    return (this.file?.settings.segment as { name: string }[]) ?? [];
  }

  index(model: string): number {
    return this.models.findIndex((each) => each.name === model);
  }

  /** What holds for a model: its own word, else that of [response]. */
  asked(model: ModelTable, key: string): unknown {
    const all = (this.file?.settings.response as Record<string, unknown>) ?? {};
    return model.response?.[key] ?? all[key];
  }

  load(): Promise<void> {
    return this.#inTurn(async () => {
      try {
        this.file = await api.study(this.log);
        this.error = "";
      } catch (error) {
        this.error = (error as Error).message;
      }
      this.known = true;
    });
  }

  /** Change keys; while others of the same keys wait, these take their place. */
  edit(edits: Edit[]): Promise<boolean> {
    const behind = this.#waiting;
    if (behind && keysOf(behind.edits) === keysOf(edits)) {
      behind.edits = edits;
      return behind.stored;
    }
    const waiting: Waiting = { edits, stored: Promise.resolve(false) };
    waiting.stored = this.#inTurn(() => {
      if (this.#waiting === waiting) this.#waiting = null;
      return this.#store(waiting.edits, (etag) => api.change(this.log, etag, waiting.edits));
    });
    this.#waiting = waiting;
    return waiting.stored;
  }

  /** Change keys whose places hang on what stands there when the turn comes. */
  editThen(make: () => Edit[]): Promise<boolean> {
    return this.#inTurn(() => {
      const edits = make();
      return this.#store(edits, (etag) => api.change(this.log, etag, edits));
    });
  }

  /** Put a whole text in place, as a proposal made anew; it can be taken back. */
  replace(text: string): Promise<boolean> {
    return this.#inTurn(() => this.#store([], (etag) => api.replace(this.log, etag, text)));
  }

  /** Versions are the server's: a reload, and the next window, go back as far. */
  undo(): Promise<boolean> {
    return this.#inTurn(async () => !!this.file?.undoable && this.#store([], (etag) => api.step(this.log, etag, true)));
  }

  redo(): Promise<boolean> {
    return this.#inTurn(async () => !!this.file?.redoable && this.#store([], (etag) => api.step(this.log, etag, false)));
  }

  /** One after the other: a request that went beside another would name a version that is gone. */
  async #inTurn<T>(task: () => Promise<T>): Promise<T> {
    this.#waiting = null;
    this.pending += 1;
    const turn = this.#turn.then(task);
    this.#turn = turn.catch(() => {});
    try {
      return await turn;
    } finally {
      this.pending -= 1;
    }
  }

  /** Keep what the other window wrote, or put these edits over it. */
  async settle(keepTheirs: boolean) {
    const mine = this.conflict?.mine ?? [];
    this.conflict = null;
    await this.load();
    if (!keepTheirs && mine.length) await this.edit(mine);
  }

  async #store(edits: Edit[], store: (etag: string) => Promise<StudyText>): Promise<boolean> {
    if (!this.file && !this.known) return false;
    if (this.conflict) {
      this.conflict.mine.push(...edits);
      return false;
    }
    const before = this.file?.text ?? "";
    try {
      this.file = await store(this.file?.etag ?? UNWRITTEN);
      this.error = "";
    } catch (error) {
      const refusal = error as api.Refusal;
      if (refusal.status === 409) {
        this.conflict = { mine: edits, ...(refusal.detail as { text: string; etag: string }) };
      } else {
        this.error = refusal.message;
      }
      return false;
    }
    const old = new Set(before.split("\n"));
    this.changed = this.file.text.split("\n").filter((line) => !old.has(line));
    return true;
  }
}
