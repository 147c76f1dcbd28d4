import type { Job, ResponseAnswer, ResponseQuestion } from "./types";

type Asked = Omit<ResponseQuestion, "request">;

/** The socket: the newest question alone is answered; news of jobs come on it too. */
class Live {
  connected = $state(false);
  jobs: Record<string, Job> = $state({});
  #socket: WebSocket | null = null;
  #last = 0;
  #waiting: ResponseQuestion | null = null;
  #hear: (answer: ResponseAnswer) => void = () => {};
  #news = new Set<(job: Job) => void>();

  open() {
    const socket = new WebSocket(`ws://${location.host}/api/live`);
    this.#socket = socket;
    socket.onopen = () => {
      this.connected = true;
      if (this.#waiting) socket.send(JSON.stringify(this.#waiting));
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
      } else if (told.request === this.#last) {
        this.#waiting = null;
        this.#hear(told);
      }
    };
  }

  /** Ask; answers to older questions are not heard any more. */
  ask(question: Asked, hear: (answer: ResponseAnswer) => void) {
    this.#hear = hear;
    this.#waiting = { ...question, request: ++this.#last };
    if (this.#socket?.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(this.#waiting));
  }

  /** Hear of jobs; returns what ends it. */
  onNews(hear: (job: Job) => void) {
    this.#news.add(hear);
    return () => this.#news.delete(hear);
  }
}

export const live = new Live();
