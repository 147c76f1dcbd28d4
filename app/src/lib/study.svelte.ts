import * as api from "./api";
import { drafts } from "./drafts";
import type { Edit, MergedStudy, StudyText } from "./types";

export interface ModelTable {
  name: string;
  axis?: string;
  identify: string[] | string;
  verify?: string[];
  band_rad_s?: [number, number];
  response?: Record<string, unknown>;
}

/** Two versions that began as one: what was meant here, and what stands in the file meanwhile. */
export interface Conflict extends MergedStudy {
  base: string;
  theirs: string;
  /** Of what stands in the file. */
  etag: string;
  /** Whether a whole text was meant: its editor closes when the other text is taken. */
  typed: boolean;
  /** Hears whether the change, or the editor of it, is done with. */
  settled: (done: boolean) => void;
}
export type Choice = "mine" | "theirs" | "both" | "later";
/** What a change was to make of the study: a text, which was made of `base`, or keys. */
interface Meant {
  text?: string;
  base?: string;
  edits?: Edit[];
}
/** What became of a change: stored or not, or a question that stands on the page until it is answered. */
type Stored = boolean | { asked: Promise<boolean> };

/** Edits that wait for their turn; whoever changes the same keys meanwhile puts newer values in. */
interface Waiting {
  edits: Edit[];
  stored: Promise<boolean>;
}
/** What a change names where there is no study yet: of a log it begins one. */
const UNWRITTEN = '""';
const UNTOUCHED = "What was changed last was not stored.";
const GONE = "The study is not in the folder any more";
const BARE: StudyText = { text: "", etag: UNWRITTEN, parts: { models: "", gains: "", views: "" }, settings: {}, python: "", outside: [], undoable: 0, redoable: 0, of_records: false, lack: GONE };
const keysOf = (edits: Edit[]) => JSON.stringify(edits.map((each) => each.path));

/** The study file of a log: every click of the page changes it here, and nowhere else. */
export class Study {
  file: StudyText | null = $state(null);
  error = $state("");
  /** Why there is none to show: it cannot be read, or stood and is gone; what is left of its text. */
  lack: StudyText | null = $state(null);
  conflict: Conflict | null = $state.raw(null);
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
        const told = await api.study(this.log);
        if (told && !told.lack) this.#stands(told);
        else this.#lost(told, null);
      } catch (error) {
        this.error = (error as Error).message;
      }
      this.known = true;
    });
  }

  /** Read the file again: an editor, another window or a run may know more than this page. */
  reread(): Promise<void> {
    return this.#inTurn(async () => {
      if (this.conflict) return;
      const told = await api.study(this.log).catch(() => null);
      if (told && !told.lack && told.etag !== this.file?.etag) this.#stands(told);
      else if (told?.lack && this.file) this.#lost(told, null);
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
    waiting.stored = this.#heard(() => {
      if (this.#waiting === waiting) this.#waiting = null;
      return this.#store((etag) => api.change(this.log, etag, waiting.edits), { edits: waiting.edits });
    });
    this.#waiting = waiting;
    return waiting.stored;
  }

  /** Change keys, and tell why that was refused; nothing where it was not. */
  async stored(edits: Edit[]): Promise<string> {
    return (await this.edit(edits)) ? "" : this.error;
  }

  /** Change keys whose places hang on what stands there when the turn comes. */
  editThen(make: () => Edit[]): Promise<boolean> {
    return this.#heard(() => {
      const edits = make();
      return this.#store((etag) => api.change(this.log, etag, edits), { edits });
    });
  }

  /** Put a whole text in place, which was made of `base`; it can be taken back. */
  replace(text: string, base?: string): Promise<boolean> {
    return this.#heard(async () => {
      const file = this.file;
      const meant = { text, base: base ?? file?.text };
      if (file && meant.base !== file.text) return this.#ask(meant, file);
      return this.#store((etag) => api.replace(this.log, etag, text), meant);
    });
  }

  /** Versions are the server's: a reload, and the next window, go back as far. */
  undo(): Promise<boolean> {
    return this.#heard(async () => !!(this.file ?? this.lack)?.undoable && this.#store((etag) => api.step(this.log, etag, true)));
  }

  redo(): Promise<boolean> {
    return this.#heard(async () => !!this.file?.redoable && this.#store((etag) => api.step(this.log, etag, false)));
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

  /** The turn ends with the question, not with its answer: whatever is asked next would wait for that. */
  async #heard(task: () => Promise<Stored>): Promise<boolean> {
    const stored = await this.#inTurn(task);
    return typeof stored === "object" && "asked" in stored ? stored.asked : stored;
  }

  /** One of both versions, both together, or neither yet: what was meant here waits as typed text. */
  async settle(choice: Choice) {
    const asked = this.conflict;
    if (!asked) return;
    this.conflict = null;
    if (choice === "later") this.#later(asked);
    if (choice === "later" || choice === "theirs") {
      await this.load();
      if (choice === "later" && !asked.typed && drafts.kept(this.place)?.text !== asked.mine) this.error = "Your change was not made: the study had changed meanwhile, and text that is not saved stands here.";
      return asked.settled(choice === "theirs" && asked.typed);
    }
    const text = choice === "both" ? asked.merged! : asked.mine;
    const stored = await this.#heard(() => this.#store(() => api.replace(this.log, asked.etag, text), { text, base: choice === "both" ? asked.theirs : asked.base }));
    if (!stored && this.error) {
      const said = this.error;
      this.#later(asked);
      await this.load();
      this.error = said;
    }
    asked.settled(stored);
  }

  /** Nothing is lost with the question: Lines takes it up, as it does what was typed there. */
  #later(asked: Conflict) {
    if (!drafts.kept(this.place)) drafts.keep(this.place, { text: asked.mine, name: "", before: asked.base });
  }

  /** Of its text, among what is typed and not saved. */
  get place() {
    return `study:${this.log}`;
  }

  async #ask(meant: Meant, now: { text: string; etag: string }): Promise<Stored> {
    const base = meant.base ?? this.file?.text ?? "";
    try {
      const told = await api.merge(this.log, { base, mine: meant.text ?? base, theirs: now.text, edits: meant.edits ?? [] });
      let settled: (done: boolean) => void = () => {};
      const asked = new Promise<boolean>((give) => (settled = give));
      this.conflict = { ...told, base, theirs: now.text, etag: now.etag, typed: meant.text !== undefined, settled };
      return { asked };
    } catch (error) {
      this.error = (error as Error).message;
      return false;
    }
  }

  async #store(store: (etag: string) => Promise<StudyText>, meant: Meant | null = null): Promise<Stored> {
    if (!this.file && !this.known) return false;
    if (this.lack && meant?.edits) {
      this.error = UNTOUCHED;
      return false;
    }
    if (this.conflict) return this.#besides(this.conflict, meant);
    const before = this.file?.text ?? "";
    try {
      this.#stands(await store((this.file ?? this.lack)?.etag || UNWRITTEN));
    } catch (error) {
      const refusal = error as api.Refusal;
      if ([404, 409].includes(refusal.status)) {
        const told = await api.study(this.log).catch(() => this.file);
        if (told?.lack || (!told && this.file)) return this.#lost(told, meant);
      }
      if (refusal.status !== 409) {
        this.error = refusal.message;
        return false;
      }
      const now = refusal.detail as { text: string; etag: string };
      if (meant) return this.#ask(meant, now);
      this.file = await api.study(this.log);
      this.error = "The study was changed elsewhere meanwhile, and stands below as it is now: no version was taken back or made again.";
      return false;
    }
    const old = new Set(before.split("\n"));
    this.changed = this.file!.text.split("\n").filter((line) => !old.has(line));
    return true;
  }

  /** What was kept of one that was lost, and nobody has typed into, needs no keeping any more. */
  #stands(told: StudyText) {
    const kept = this.lack && drafts.kept(this.place);
    if (kept && kept.text === kept.before) drafts.drop(this.place);
    [this.file, this.lack, this.error] = [told, null, ""];
  }

  /** None stands that can be read: what was typed, else what stood here, waits to be written again. */
  #lost(told: StudyText | null, meant: Meant | null): boolean {
    const stood = this.file;
    const waits = drafts.kept(this.place);
    // A file that cannot be read has its own text: what was typed alone would be lost with this page.
    const left = meant?.text ?? (told?.lack && told.text ? undefined : stood?.text);
    if (!waits && left !== undefined) drafts.keep(this.place, { text: left, name: "", before: stood?.text ?? "" });
    const gone = stood || waits ? { ...BARE, of_records: stood?.of_records ?? false } : null;
    [this.file, this.lack] = [null, told ?? gone];
    this.error = meant ? UNTOUCHED : "";
    return false;
  }

  /** Keys that were changed before the question stood there are of what is asked about. */
  async #besides(asked: Conflict, meant: Meant | null): Promise<boolean> {
    if (!meant?.edits) return false;
    try {
      const mine = await api.merge(this.log, { base: asked.base, mine: asked.mine, theirs: asked.theirs, edits: meant.edits });
      if (this.conflict === asked) this.conflict = { ...asked, ...mine };
    } catch (error) {
      this.error = (error as Error).message;
    }
    return false;
  }
}
