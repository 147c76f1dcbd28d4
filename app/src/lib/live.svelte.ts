import type { Reply, Job, Question } from "./types";

/** A question waiting for its answer, and who hears it. */
interface Waiting {
  question: Question;
  answered: boolean;
  hear: (answer: never) => void;
}

/** The socket: of each kind the newest question alone is answered; news of jobs come on it too. */
class Live {
  connected = $state(false);
  jobs: Record<string, Job> = $state({});
  #socket: WebSocket | null = null;
  #last = 0;
  #waiting: Record<string, Waiting> = {};
  #news = new Set<(job: Job) => void>();

  open() {
    const socket = new WebSocket(`ws://${location.host}/api/live`);
    this.#socket = socket;
    socket.onopen = () => {
      this.connected = true;
      for (const each of Object.values(this.#waiting)) if (!each.answered) socket.send(JSON.stringify(each.question));
    };
    socket.onclose = () => {
      this.connected = false;
      setTimeout(() => this.open(), 1500);
    };
    socket.onmessage = (event) => {
      const told = JSON.parse(event.data);
      if (told.job) {
        this.jobs[told.job.id] = told.job;
        for (const hear of this.#news) hear(told.job);
        return;
      }
      const waiting = Object.values(this.#waiting).find((each) => each.question.request === told.request);
      if (!waiting) return;
      waiting.answered = true;
      waiting.hear(told as never);
    };
  }

  /** Ask; answers to older questions of this kind are not heard any more. */
  ask<Q extends Question, A extends Reply>(kind: string, question: Omit<Q, "request" | "kind">, hear: (answer: A) => void) {
    const made = { ...question, kind, request: ++this.#last } as unknown as Q;
    this.#waiting[kind] = { question: made, answered: false, hear };
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(made));
  }

  /** Hear of jobs; returns what ends it. */
  onNews(hear: (job: Job) => void) {
    this.#news.add(hear);
    return () => this.#news.delete(hear);
  }
}

export const live = new Live();
