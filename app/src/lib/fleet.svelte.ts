import * as api from "./api";
import { live } from "./live.svelte";
import type { FleetHappening, FleetListing, FleetPart, FleetDraft, FleetRows, FleetScreen, FleetVehiclePart } from "./types";

export const fleets = () => api.json<FleetListing>("/api/fleets");
export const propose = (folder: string) => api.json<FleetDraft>("/api/fleets", api.sent("POST", { folder }));
export const query = (id: string, sql: string) => api.json<FleetRows>(`/api/fleets/${id}/query`, api.sent("POST", { sql }));
const EVERY_MS = 2000;

/** One fleet: how far it is, what its catalogue answers, a vehicle of it. */
export class Fleet {
  screen: FleetScreen | null = $state(null);
  part: FleetPart | null = $state(null);
  vehicle: FleetVehiclePart | null = $state(null);
  error = $state("");
  busy = $state(false);
  #closed = false;

  constructor(readonly id: string) {}

  get job() {
    return this.screen?.jobs[0] ?? null;
  }

  get runs() {
    return this.job?.state === "waiting";
  }

  /** Load it, and hear of its runs; returns what ends that. */
  open() {
    this.load().then(() => this.answer());
    const clock = setInterval(() => this.runs && this.load(), EVERY_MS);
    const ended = live.onNews((job) => {
      if (job.kind === "fleet" && job.log === this.id && job.state !== "waiting") this.load().then(() => this.answer());
    });
    return () => {
      this.#closed = true;
      clearInterval(clock);
      ended();
    };
  }

  async load() {
    await this.#try(async () => { this.screen = await api.json<FleetScreen>(`/api/fleets/${this.id}`); });
  }

  async answer() {
    if (!this.screen || this.screen.words || !Object.keys(this.screen.outcomes).length) return;
    this.busy = true;
    await this.#try(async () => { this.part = await api.json<FleetPart>(`/api/fleets/${this.id}/answers`); });
    this.busy = false;
  }

  async run() {
    await this.#try(async () => { this.screen = await api.json<FleetScreen>(`/api/fleets/${this.id}/run`, api.sent("POST", {})); });
  }

  /** Write an event into the fleet file, and ask anew; whether it stands there. */
  async happened(event: FleetHappening) {
    await this.#try(async () => { this.screen = await api.json<FleetScreen>(`/api/fleets/${this.id}/events`, api.sent("POST", event)); });
    if (this.error) return false;
    const shown = this.vehicle?.name ?? "";
    await this.answer();
    if (shown) await this.look(shown, true);
    return true;
  }

  async look(name: string, again = false) {
    if (this.vehicle?.name !== name) this.vehicle = null;
    if (name || again) await this.#try(async () => { this.vehicle = await api.json<FleetVehiclePart>(`/api/fleets/${this.id}/vehicle?name=${encodeURIComponent(name)}`); });
  }

  async #try(work: () => Promise<void>) {
    try {
      await work();
      this.error = "";
    } catch (problem) {
      if (!this.#closed) this.error = (problem as Error).message;
    }
  }
}
