import * as api from "./api";
import { drafts } from "./drafts";
import { unstored } from "./stands.svelte";
import type { Draft, Edit, MergedStudy, StudyText } from "./types";

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
const MOVED = "The study was changed elsewhere meanwhile, and stands below as it is now: no version was taken back or made again.";
const BARE: StudyText = { text: "", etag: UNWRITTEN, parts: { models: "", gains: "", views: "" }, settings: {}, python: "", outside: [], undoable: 0, redoable: 0, of_records: false, state: "lost", lack: GONE };
const keysOf = (edits: Edit[]) => JSON.stringify(edits.map((each) => each.path));
const seemsSame = (one: StudyText | null, other: StudyText | null) => (["etag", "state", "lack", "undoable", "redoable"] as const).every((key) => one?.[key] === other?.[key]);

/**
 * The study file of a log: every click of the page changes it here, and nowhere else. What the server
 * told last and what a hand has typed are its whole state; all that screens show is derived from both.
 */
export class Study {
  #told: StudyText | null = $state(null);
  /** Text that this page has shown last as a study that can be read. */
  #shown: StudyText | null = $state.raw(null);
  /** The whole text as a hand has typed it, and the one from which it began. */
  typed: Draft | null = $state.raw(null);
  /** Whether that was typed before this page, or the screen that is shown, was opened. */
  again = $state(false);
  /** Whether another window has typed it, whose words stay when this one's are stored or thrown away. */
  elsewhere = $state(false);
  error = $state("");
  conflict: Conflict | null = $state.raw(null);
  changed: string[] = $state([]);
  /** Whether the server was asked once: before that nobody knows whether there is a study. */
  known = $state(false);
  /** Requests that wait or are under way; each begins when the one before it has ended. */
  pending = $state(0);
  #turn: Promise<unknown> = Promise.resolve();
  #waiting: Waiting | null = null;
  constructor(readonly log: string) {}

  /** The study where it can be read. */
  get file(): StudyText | null {
    return this.#told?.state === "readable" ? this.#told : null;
  }

  /** Why there is none to show, and what is left of its text: it cannot be read, or stood and is gone. */
  get lack(): StudyText | null {
    if (this.#told) return this.file ? null : this.#told;
    if (!this.known || !(this.#shown || this.typed)) return null;
    return { ...BARE, text: this.#shown?.text ?? "", of_records: this.#shown?.of_records ?? false };
  }

  /** Whether one that cannot be read had models when it could; of what nobody has seen it is supposed. */
  get lackedModels(): boolean {
    return this.lack !== null && (this.#shown === null || ((this.#shown.settings.model as ModelTable[]) ?? []).length > 0);
  }

  /** Text that stands, whether it can be read or not; of one that is lost what stood last. */
  get text(): string {
    return (this.#told ?? this.#shown)?.text ?? "";
  }

  /** Whether a text stands that another may take the place of. */
  get stands(): boolean {
    return this.#told?.state === "readable" || this.#told?.state === "unreadable";
  }

  /** Whether nobody but this page knows of one that is lost. */
  get alone(): boolean {
    return this.#told === null && this.lack !== null;
  }

  /** Whether other words stand now than those from which the typed ones began. */
  get moved(): boolean {
    return this.typed !== null && this.typed.before !== this.text;
  }

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
        this.#take(await api.study(this.log));
        this.error = "";
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
      try {
        const told = await api.study(this.log);
        if (this.known && seemsSame(told, this.#told)) return;
        this.#take(told);
        this.error = "";
      } catch {
        // whoever asks for more hears why nobody answers
      }
    });
  }

  /** What the server knows takes the place of what it knew; words that nobody typed are none. */
  #take(told: StudyText | null) {
    this.#told = told;
    this.known = true;
    if (this.file) this.#shown = this.file;
    const kept = this.typed ?? drafts.kept(this.place);
    const idle = kept && told && (kept.text === kept.before || kept.text === told.text);
    if (idle) drafts.drop(this.place);
    if (idle) this.elsewhere = false;
    if (!idle && !this.typed && kept) this.again = true;
    this.typed = idle ? null : kept;
  }

  /** The whole text as a hand types it: kept until it is stored or thrown away. */
  type(text: string) {
    const before = this.typed?.before ?? this.text;
    [this.again, this.elsewhere] = [false, false];
    if (text === before || text === this.text) return this.#untype();
    this.#keep({ text, name: "", before });
  }

  #keep(typed: Draft) {
    this.typed = typed;
    drafts.keep(this.place, typed);
  }

  #untype() {
    [this.typed, this.again, this.elsewhere] = [null, false, false];
    drafts.drop(this.place);
  }

  /** Take up what another window has typed and the folder keeps, where nothing is typed here. */
  offer() {
    const kept = this.typed ? null : drafts.kept(this.place);
    if (kept && kept.text !== this.text) [this.typed, this.again, this.elsewhere] = [kept, true, true];
  }

  /** Throw away what was typed, and of a study that nobody but this page knows what stood. */
  discard() {
    this.#untype();
    if (!this.#told) this.#shown = null;
  }

  /** Store the text that is typed, or the one that is left. */
  save(): Promise<boolean> {
    const { text, before } = this.typed ?? { text: this.text, before: this.text };
    return this.replace(text, before);
  }

  /** Change keys; while others of the same keys wait, these take their place. */
  edit(edits: Edit[]): Promise<boolean> {
    const behind = this.#waiting;
    if (behind && keysOf(behind.edits) === keysOf(edits)) {
      behind.edits = edits;
      return behind.stored;
    }
    const waiting: Waiting = { edits, stored: Promise.resolve(false) };
    waiting.stored = this.#changed(() => {
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
    return this.#changed(() => {
      const edits = make();
      return this.#store((etag) => api.change(this.log, etag, edits), { edits });
    });
  }

  /** Put a whole text in place, which was made of `base`; it can be taken back. */
  replace(text: string, base: string): Promise<boolean> {
    return this.#heard(async () => {
      const meant = { text, base };
      // Nothing is written over words that whoever wrote this had not before his eyes.
      if (this.stands && base !== this.text) return this.#ask(meant);
      return this.#store((etag) => api.replace(this.log, etag, text), meant);
    });
  }

  /** Versions are the server's: a reload, and the next window, go back as far. */
  undo(): Promise<boolean> {
    return this.#heard(async () => !!this.#told?.undoable && this.#store((etag) => api.step(this.log, etag, true)));
  }

  redo(): Promise<boolean> {
    return this.#heard(async () => !!this.#told?.redoable && this.#store((etag) => api.step(this.log, etag, false)));
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

  /** Fields that have asked for a change which was not made show what stands again. */
  async #changed(task: () => Promise<Stored>): Promise<boolean> {
    const stored = await this.#heard(task);
    if (!stored) unstored.times += 1;
    return stored;
  }

  /** One of both versions, both together, or neither yet: what was meant here waits as typed text. */
  async settle(choice: Choice) {
    const asked = this.conflict;
    if (!asked) return;
    this.conflict = null;
    if (choice === "later" || choice === "theirs") {
      const waits = choice === "theirs" || (await this.#later(asked));
      if (choice === "theirs" && asked.typed) this.#untype();
      await this.load();
      if (!waits) this.error = "Your change was not made: the study had changed meanwhile, and text that is not saved stands here.";
      return asked.settled(choice === "theirs" && asked.typed);
    }
    const text = choice === "both" ? asked.merged! : asked.mine;
    const stored = await this.#heard(() => this.#store(() => api.replace(this.log, asked.etag, text), { text, base: choice === "both" ? asked.theirs : asked.base }));
    if (stored && asked.typed) this.#untype();
    if (!stored && this.error) {
      const said = this.error;
      await this.#later(asked);
      await this.load();
      this.error = said;
    }
    asked.settled(stored);
  }

  /**
   * Nothing is lost with the question: it is taken up as what was typed is, among the words that are;
   * false: these are of the same lines, or began elsewhere.
   */
  async #later(asked: Conflict): Promise<boolean> {
    const [typed, { base, mine }] = [this.typed, asked];
    if (asked.typed && typed) return true;
    if (!typed) this.#keep({ text: mine, name: "", before: base });
    else if (typed.before === base) {
      const both = await api.merge(this.log, { base, mine, theirs: typed.text, edits: [] }).catch(() => null);
      if (!both || both.merged === null || this.typed?.text !== typed.text) return false;
      this.#keep({ ...typed, text: both.merged });
    }
    return this.typed?.text === mine || typed?.before === base;
  }

  /** Of its text, among what is typed and not saved. */
  get place() {
    return `study:${this.log}`;
  }

  /** What was meant, beside the text that stands now. */
  async #ask(meant: Meant): Promise<Stored> {
    const [base, theirs, etag] = [meant.base!, this.text, this.#told!.etag];
    try {
      const told = await api.merge(this.log, { base, mine: meant.text ?? base, theirs, edits: meant.edits ?? [] });
      let settled: (done: boolean) => void = () => {};
      const asked = new Promise<boolean>((give) => (settled = give));
      this.conflict = { ...told, base, theirs, etag, typed: meant.text !== undefined, settled };
      return { asked };
    } catch (error) {
      this.error = (error as Error).message;
      return false;
    }
  }

  async #store(store: (etag: string) => Promise<StudyText>, meant: Meant | null = null): Promise<Stored> {
    if (!this.known) return false;
    if (this.lack && meant?.edits) {
      this.error = UNTOUCHED;
      return false;
    }
    if (this.conflict) return this.#besides(this.conflict, meant);
    const before = this.text;
    try {
      this.#take(await store(this.#told?.etag || UNWRITTEN));
    } catch (error) {
      return this.#refused(error as api.Refusal, meant && { ...meant, base: meant.base ?? before });
    }
    const old = new Set(before.split("\n"));
    this.error = "";
    this.changed = (this.file?.text ?? "").split("\n").filter((line) => !old.has(line));
    return true;
  }

  /** Not stored: where other words stand than this page knew both are shown, else the reason is said. */
  async #refused(refusal: api.Refusal, meant: Meant | null): Promise<Stored> {
    this.error = (meant?.text === undefined ? "" : "Not written: ") + refusal.message;
    if (![404, 409].includes(refusal.status)) return false;
    const told = await api.study(this.log).catch(() => undefined);
    if (told === undefined) return false;
    this.#take(told);
    // A text can be laid beside any other; keys only beside one that has them.
    if (meant && (meant.text !== undefined ? this.stands : this.file)) return this.#ask(meant);
    if (meant?.text !== undefined && !this.typed && meant.text !== this.text) this.#keep({ text: meant.text, name: "", before: meant.base! });
    if (this.lack) this.error = meant ? UNTOUCHED : "";
    else if (refusal.status === 409) this.error = MOVED;
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
