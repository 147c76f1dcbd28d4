import * as api from "./api";
import { live } from "./live.svelte";
import type { Job, RunPart } from "./types";

/** The last whole run of a study, and the one that goes on. */
export class Runs {
  part: RunPart | null = $state(null);
  job: Job | null = $state(null);
  /** Files that the study names and a zip of it does not hold. */
  leftOut: string[] = $state([]);
  error = $state("");

  constructor(readonly log: string) {
    this.load();
  }

  get waiting() {
    return this.job?.state === "waiting";
  }

  /** What goes on, or what a server that ended left undone: that is offered again. */
  get work() {
    return this.job && ["waiting", "interrupted"].includes(this.job.state) ? this.job : null;
  }

  async load() {
    await this.#heard(api.lastRun(this.log));
  }

  async begin() {
    await this.#heard(api.run(this.log));
  }

  /** Hear of its job; returns what ends it. */
  listen() {
    return live.onNews((job) => {
      if (job.kind !== "run" || job.log !== this.log) return;
      this.job = job;
      if (job.state !== "waiting") this.load();
    });
  }

  async #heard(asked: ReturnType<typeof api.lastRun>) {
    try {
      const told = await asked;
      this.part = told.run;
      this.leftOut = told.left_out;
      this.job = told.jobs[0] ?? null;
      this.error = this.job?.state === "failed" ? this.job.reason : "";
    } catch (problem) {
      this.error = (problem as Error).message;
    }
  }
}
