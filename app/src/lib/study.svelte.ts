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

/** The study file of a log: every click of the page changes it here, and nowhere else. */
export class Study {
  file: StudyText | null = $state(null);
  error = $state("");
  conflict: { mine: Edit[]; text: string; etag: string } | null = $state(null);
  changed: string[] = $state([]);
  #before: string[] = [];
  undoable = $state(0);

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

  async load() {
    try {
      this.file = await api.study(this.log);
      this.error = "";
    } catch (error) {
      this.error = (error as Error).message;
    }
  }

  async edit(edits: Edit[]): Promise<boolean> {
    if (!this.file) return false;
    return this.#store(edits, () => api.change(this.log, this.file!.etag, edits));
  }

  /** Put a whole text in place, as a proposal made anew; it can be taken back. */
  async replace(text: string): Promise<boolean> {
    if (!this.file) return false;
    return this.#store([], () => api.replace(this.log, this.file!.etag, text));
  }

  async undo() {
    const text = this.#before.at(-1);
    if (text === undefined || !this.file) return;
    if (await this.#store([], () => api.replace(this.log, this.file!.etag, text))) {
      this.#before.splice(-2);
      this.undoable = this.#before.length;
    }
  }

  /** Keep what the other window wrote, or put these edits over it. */
  async settle(keepTheirs: boolean) {
    const mine = this.conflict?.mine ?? [];
    this.conflict = null;
    await this.load();
    if (!keepTheirs && mine.length) await this.edit(mine);
  }

  async #store(edits: Edit[], store: () => Promise<StudyText>): Promise<boolean> {
    const before = this.file!.text;
    try {
      this.file = await store();
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
    this.#before.push(before);
    this.undoable = this.#before.length;
    const old = new Set(before.split("\n"));
    this.changed = this.file.text.split("\n").filter((line) => !old.has(line));
    return true;
  }
}
