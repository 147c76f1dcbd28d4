import * as api from "./api";
import { live } from "./live.svelte";
import type { GainsPart, Job } from "./types";

/** Gains of a study as it stands, and the work on them; those of before stay until that is done. */
export class Gains {
  part: GainsPart | null = $state(null);
  /** Version of the study that was asked about, and the one that `part` is of. */
  etag = $state("");
  of = $state("");
  job: Job | null = $state(null);
  error = $state("");
  #asked = 0;

  constructor(readonly log: string) {}

  /** Whether the study has gone on since. */
  get stale() {
    return this.of !== this.etag;
  }

  /** The work, while it goes on or what it was to make is missing; one that ended of other gains is past. */
  get work() {
    return this.job?.state === "waiting" || this.stale || !this.part ? this.job : null;
  }

  /** Of several answers the one to the last question counts: an older one speaks of another study. */
  async ask(again = false) {
    const mine = ++this.#asked;
    try {
      const told = await api.gains(this.log, again);
      if (mine !== this.#asked) return;
      this.etag = told.etag;
      this.job = told.jobs[0] ?? null;
      this.error = this.job?.state === "failed" ? this.job.reason : "";
      if (told.gains) {
        this.part = told.gains;
        this.of = told.etag;
      }
    } catch (problem) {
      if (mine === this.#asked) this.error = (problem as Error).message;
    }
  }

  /** Hear of the work; returns what ends it. */
  listen() {
    return live.onNews((job) => {
      if (job.kind !== "gains" || job.log !== this.log) return;
      const ended = job.state !== "waiting";
      if (!ended || job.state === "cancelled") this.job = job;
      else this.ask();
    });
  }
}
