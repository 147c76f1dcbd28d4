import { onDestroy } from "svelte";
import * as api from "./api";
import type { Reply, Job, Question } from "./types";

/** A question waiting for its answer, and who hears it. */
interface Waiting {
  question: Question;
  answered: boolean;
  hear: (answer: never) => void;
}

/** How long a page says no more than that it connects, and how often it tries. */
const PATIENCE_MS = 4000;
const AGAIN_MS = 1500;

/** The socket: of each kind the newest question alone is answered; news of jobs come on it too. */
class Live {
  connected = $state(false);
  /** Why nothing goes on: nobody answers, or one who was started after this page was opened. */
  lost = $state<"" | "silent" | "anew">("");
  jobs: Record<string, Job> = $state({});
  #socket: WebSocket | null = null;
  #last = 0;
  #since = performance.now();
  #waiting: Record<string, Waiting> = {};
  #news = new Set<(job: Job) => void>();
  /** Jobs that the socket has told of since the list was asked for: the list is older than they are. */
  #heard = new Set<string>();
  #counts = 0;

  open() {
    const socket = new WebSocket(`ws://${location.host}/api/live`);
    this.#socket = socket;
    socket.onopen = () => {
      this.connected = true;
      this.lost = "";
      this.#recount();
      for (const each of Object.values(this.#waiting)) if (!each.answered) socket.send(JSON.stringify(each.question));
    };
    socket.onclose = () => {
      if (this.connected) this.#since = performance.now();
      this.connected = false;
      if (performance.now() - this.#since > PATIENCE_MS - AGAIN_MS) this.#why();
      setTimeout(() => this.open(), AGAIN_MS);
    };
    socket.onmessage = (event) => {
      const told = JSON.parse(event.data);
      if (told.job) {
        this.#heard.add(told.job.id);
        this.#put(told.job);
        return;
      }
      const waiting = Object.values(this.#waiting).find((each) => each.question.request === told.request);
      if (!waiting) return;
      waiting.answered = true;
      waiting.hear(told as never);
    };
  }

  /**
   * Questions of one kind by the component that is being made; of several the newest alone is answered.
   * Once it is gone nothing is heard and nothing asked: an answer that came late asked on for nobody.
   */
  asker<Q extends Question, A extends Reply>(kind: string) {
    let gone = false;
    let mine: Waiting | null = null;
    onDestroy(() => {
      gone = true;
      // Another component may have asked meanwhile.
      if (mine && this.#waiting[kind] === mine) delete this.#waiting[kind];
    });
    return (question: Omit<Q, "request" | "kind">, hear: (answer: A) => void) => {
      if (gone) return;
      const made = { ...question, kind, request: ++this.#last } as unknown as Q;
      this.#waiting[kind] = mine = { question: made, answered: false, hear };
      if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(made));
    };
  }

  /** What a socket does not tell: whether anybody is there, and knows this page. */
  async #why() {
    try {
      await api.jobs();
    } catch (problem) {
      const { status } = problem as api.Refusal;
      if (!this.connected) this.lost = status === 0 ? "silent" : [401, 403].includes(status) ? "anew" : "";
    }
  }

  /** End a job; one that has ended meanwhile is none that the server knows. */
  async cancel(id: string) {
    await api.cancel(id).catch(() => {});
    await this.#recount();
  }

  /** Jobs that the server knows; what it does not know any more has ended unheard. */
  async #recount() {
    const mine = ++this.#counts;
    this.#heard.clear();
    const told = await api.jobs().catch(() => null);
    if (!told || mine !== this.#counts) return;
    const known = new Set(told.map((job) => job.id));
    const ended = Object.values(this.jobs).filter((job) => job.state === "waiting" && !known.has(job.id));
    for (const job of [...told, ...ended.map((each) => ({ ...each, state: "done" as const }))]) if (!this.#heard.has(job.id)) this.#put(job);
  }

  /** The one place where a job comes in: what a screen was told with its results is older than news. */
  #put(job: Job) {
    this.jobs[job.id] = job;
    for (const hear of this.#news) hear(job);
  }

  /** Hear of jobs; returns what ends it. */
  onNews(hear: (job: Job) => void) {
    this.#news.add(hear);
    return () => this.#news.delete(hear);
  }
}

export const live = new Live();
