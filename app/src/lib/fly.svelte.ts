import { Refusal } from "./api";
import type { CooperHarperRating, FlownItem, FlownRecords, FlyChoice, FlyFrame, FlyNews, FlyStart, FlySweep, FlySwitch, OwnVehicles } from "./types";

export type Hand = "pitch" | "roll" | "yaw" | "heave";
export type Sticks = Record<Hand, number>;
type State = "closed" | "ready" | "flying" | "paused" | "ended" | "refused";
const KEPT_S = 20;

async function json<T>(path: string, body?: unknown): Promise<T> {
  const sent: RequestInit = body === undefined ? {} : { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) };
  const answer = await fetch(path, { credentials: "same-origin", ...sent });
  const told = await answer.json();
  if (answer.ok) return told;
  throw new Refusal(answer.status, typeof told.error === "string" ? told.error : typeof told.detail === "string" ? told.detail : "The server refused this.");
}
export const vehicles = () => json<FlyChoice[]>("/api/fly/vehicles");
export const ownVehicles = () => json<OwnVehicles>("/api/fly/own");
export const flights = () => json<FlownItem[]>("/api/fly/flights");
export const finish = (id: string) => json<FlownItem[]>(`/api/fly/flights/${id}/finish`, {});
/** A copy of the record among the records of rigs, where it can be identified. */
export const asRecords = (id: string) => json<FlownRecords>(`/api/fly/flights/${id}/records`, {});
/** What a study says of a flight, to fly it so; of a kept one, or of a file that was chosen. */
export const settings = (text: string, flight: string | null = null) => json<FlyStart>("/api/fly/settings", { text, flight });
export async function studyOf(id: string): Promise<string> {
  const answer = await fetch(`/api/fly/flights/${id}/study`, { credentials: "same-origin" });
  if (!answer.ok) throw new Refusal(answer.status, "This flight has no study: it was flown before flights had one.");
  return answer.text();
}
export const rate = (id: string, rating: CooperHarperRating) => json<FlownItem[]>(`/api/fly/flights/${id}/rating`, rating);

/** One instant of the strip: time, stick of the hand, attitude. */
export interface Trace {
  time_s: number;
  stick: Sticks;
  phi: number;
  theta: number;
}

/** A flight: its socket, the newest frame, and the last seconds for the strip. */
export class Flying {
  state: State = $state("closed");
  words = $state("");
  kept: string | null = $state(null);
  /** From a stick that was sent to the frame that has flown it, ms, smoothed. */
  latency = $state(0);
  frame: FlyFrame | null = null;
  traces: Trace[] = [];
  #socket: WebSocket | null = null;
  #number = 0;
  #sent = new Map<number, number>();
  #stick: Sticks = { pitch: 0, roll: 0, yaw: 0, heave: 0 };
  #closed = false;

  open() {
    const socket = new WebSocket(`ws://${location.host}/api/fly`);
    this.#socket = socket;
    socket.onmessage = (event) => this.#hear(JSON.parse(event.data));
    socket.onclose = () => {
      if (this.#closed) return;
      if (this.state === "flying" || this.state === "paused") this.words = "The line to the server broke; what was flown is kept.";
      const refused = this.state === "refused";
      this.state = refused ? "refused" : "closed";
      setTimeout(() => !this.#closed && this.open(), refused ? 4000 : 1500);
    };
  }

  close() {
    this.#closed = true;
    this.#socket?.close();
  }

  #hear(news: FlyNews) {
    if (news.frame) {
      this.frame = news.frame;
      const { pose, time_s, number } = news.frame;
      this.traces.push({ time_s, stick: { ...this.#stick }, phi: pose.phi, theta: pose.theta });
      while (this.traces.length && this.traces[0].time_s < time_s - KEPT_S) this.traces.shift();
      const begun = this.#sent.get(number);
      if (begun !== undefined) {
        const took = performance.now() - begun;
        this.latency = this.latency ? 0.9 * this.latency + 0.1 * took : took;
        for (const each of this.#sent.keys()) if (each <= number) this.#sent.delete(each);
      }
      return;
    }
    if (news.words) this.words = news.words;
    if (news.state === "refused" && (this.state === "flying" || this.state === "paused")) return;
    if (news.state) this.state = news.state;
    if (news.state === "ended" || news.state === "paused") this.#sent.clear();
    if (news.kept) this.kept = news.kept;
  }

  #send(order: object) {
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(order));
  }

  start(asked: Omit<FlyStart, "do">) {
    this.words = "";
    this.traces = [];
    this.frame = null;
    this.latency = 0;
    this.#sent.clear();
    this.#send({ do: "start", ...asked });
  }

  /** Tell where the hand is, if it has moved. */
  stick(to: Sticks) {
    if ((Object.keys(to) as Hand[]).every((each) => to[each] === this.#stick[each]) && this.#number) return;
    this.#stick = { ...to };
    if (this.state !== "flying") return;
    this.#sent.set(++this.#number, performance.now());
    this.#send({ do: "stick", number: this.#number, stick: to });
  }

  switch(asked: Omit<FlySwitch, "do">) { this.#send({ do: "switch", ...asked }); }
  sweep(asked: Omit<FlySweep, "do">) { this.words = ""; this.#send({ do: "sweep", ...asked }); }
  order(what: "pause" | "resume" | "end") { this.#send({ do: what }); }
}
