import type { Drafts, PlacedDraft, RemovedItem, CompareRequest, ComparisonPart, Edit, FieldGroup, FilterScreen, FlightScreen, FormulaUnit, GainsScreen, Job, Listing, LogItem, MergedStudy, ModelAnswer, OwnModelAnswer, OwnModel, PlanPart, PlanRequest, PlotLayout, ProposedStudy, RigItem, RigScreen, RunScreen, ShownModel, StudyComparison, StudyText, TwoStudies, UseEdits } from "./types";

/** A refusal of the server, in its own words. */
export class Refusal extends Error {
  constructor(
    readonly status: number,
    message: string,
    readonly detail: unknown = null,
  ) {
    super(message);
  }
}

async function refused(answer: Response): Promise<never> {
  const text = await answer.text();
  try {
    const told = JSON.parse(text);
    const words = told.error ?? told.detail ?? text;
    throw new Refusal(answer.status, typeof words === "string" ? words : text, told.detail);
  } catch (error) {
    if (error instanceof Refusal) throw error;
    throw new Refusal(answer.status, text.trim() || `The server answered ${answer.status}.`);
  }
}

async function ask(path: string, options: RequestInit = {}): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(path, { credentials: "same-origin", ...options });
  } catch {
    throw new Refusal(0, "flightid did not answer: see on the terminal that it runs, and ask again.");
  }
  return answer.ok ? answer : refused(answer);
}

export async function json<T>(path: string, options: RequestInit = {}): Promise<T> {
  return (await ask(path, options)).json();
}

export const sent = (method: string, body: unknown, headers: Record<string, string> = {}) => ({
  method,
  headers: { "content-type": "application/json", ...headers },
  body: JSON.stringify(body),
});

export const workspace = () => json<Listing>("/api/workspace");
export const removed = () => json<RemovedItem[]>("/api/removed");
/** Take a log or records off the list, or put them back; the files stay where they are. */
export const takeOff = (id: string, removed: boolean) => json<RemovedItem[]>("/api/removed", sent("POST", { id, removed }));
export const flight = (log: string) => json<FlightScreen>(`/api/logs/${log}`);
export const fields = (log: string) => json<FieldGroup[]>(`/api/logs/${log}/fields`);
export const study = (log: string) => json<StudyText | null>(`/api/studies/${log}`);
export const gains = (log: string, again = false) => json<GainsScreen>(`/api/gains/${log}?again=${again}`, sent("POST", {}));
export const compare = (asked: CompareRequest) => json<ComparisonPart>("/api/comparisons", sent("POST", asked));
export const compareStudies = (before: string, after: string) => json<StudyComparison>("/api/comparisons/studies", sent("POST", { before, after }));
export const plan = (asked: PlanRequest) => json<PlanPart>("/api/plans", sent("POST", asked));
export const library = () => json<ShownModel[]>("/api/library");
export const model = (log: string, name: string, edits: Edit[] = []) => json<ModelAnswer>(`/api/models/${log}`, sent("POST", { model: name, edits }));
export const useModel = (log: string, body: unknown) => json<UseEdits>(`/api/models/${log}/use`, sent("POST", body));
export const ownModel = (log: string, name: string, text: string, keep: boolean) => json<OwnModelAnswer>(`/api/models/${log}/own`, sent("POST", { name, text, keep }));
export const ownText = (log: string, name: string) => json<OwnModel>(`/api/models/${log}/own/${encodeURIComponent(name)}`);
export const jobs = () => json<Job[]>("/api/jobs");
export const cancel = (id: string) => json<Job[]>(`/api/jobs/${id}`, { method: "DELETE" });
export const again = (job: Job) => json<Job[]>("/api/jobs", sent("POST", job));
export const change = (log: string, etag: string, edits: Edit[]) =>
  json<StudyText>(`/api/studies/${log}`, sent("PATCH", { edits }, { "if-match": etag }));
export const replace = (log: string, etag: string, text: string) =>
  json<StudyText>(`/api/studies/${log}`, sent("POST", { text }, { "if-match": etag }));
/** Lay two versions of a study side by side; nothing is written. */
export const merge = (log: string, two: TwoStudies) => json<MergedStudy>(`/api/studies/${log}/merge`, sent("POST", two));
/** To the version before, or to the next again. */
export const step = (log: string, etag: string, back: boolean) =>
  json<StudyText>(`/api/studies/${log}/step`, sent("POST", { back }, { "if-match": etag }));

/** A file without a date has that of the moment in which the browser was handed it. */
const DATED_MS = 2000;
/** Send a file as it lies on the disk, dropped at some time, ms; `seen` hears how much of it has gone. */
export const upload = (file: File, at: number, seen: (share: number) => void) =>
  put<LogItem>(`/api/logs?name=${encodeURIComponent(file.name)}&modified_ms=${at - file.lastModified > DATED_MS ? file.lastModified : 0}`, file, seen);
/** The same for a file of columns; `rig` names the set that it joins. */
export const uploadRecords = (file: File, rig: string, seen: (share: number) => void) =>
  put<RigItem>(`/api/records?name=${encodeURIComponent(file.name)}&rig=${rig}`, file, seen);

function put<T>(path: string, file: File, seen: (share: number) => void): Promise<T> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("PUT", path);
    request.setRequestHeader("content-type", "application/octet-stream");
    request.upload.onprogress = (event) => seen(event.loaded / Math.max(1, event.total));
    request.onerror = () => reject(new Refusal(0, "The file could not be sent."));
    request.onload = () => {
      if (request.status === 200) return resolve(JSON.parse(request.responseText));
      let words = request.responseText;
      try {
        const told = JSON.parse(words);
        words = told.error ?? told.detail ?? words;
      } catch {
        // the words are the answer
      }
      reject(new Refusal(request.status, words));
    };
    request.send(file);
  });
}

type Reading = { time_column?: string | null; sample_time_s?: number | null; resample_to_s?: number | null; hold?: string | null };
const asked = (reading: Reading) => new URLSearchParams(Object.entries(reading).filter(([, each]) => each).map(([key, each]) => [key, String(each)]));
export const rigs = () => json<RigItem[]>("/api/records");
export const rig = (id: string, reading: Reading) => json<RigScreen>(`/api/records/${id}?${asked(reading)}`);
/** Take a file out of a set, or put it back; it stays where it is. */
export const leaveOut = (id: string, name: string, out: boolean) => json<RigItem>(`/api/records/${id}/files`, sent("POST", { name, out }));
export const propose = (id: string, body: unknown) => json<ProposedStudy>(`/api/records/${id}/study`, sent("POST", body));
/** The study that a log asks for; nothing is written. */
export const proposeOfLog = (log: string) => json<ProposedStudy>(`/api/logs/${log}/study`, sent("POST", {}));
export const lastRun = (log: string) => json<RunScreen>(`/api/runs/${log}`);
export const run = (log: string) => json<RunScreen>(`/api/runs/${log}`, sent("POST", {}));
export const runFigure = (log: string, number: number) => json<{ data: object[]; layout: Record<string, any> }>(`/api/runs/${log}/figures/${number}`);
export async function rigView(id: string, file: string, manoeuvre: string, series: string[], span: [number, number], columns: number, reading: Reading, inputs: string[]) {
  const query = asked(reading);
  for (const name of inputs) query.append("inputs", name);
  for (const name of series) query.append("series", name);
  for (const [key, value] of Object.entries({ file, manoeuvre, start_s: span[0], stop_s: span[1], columns: Math.max(10, Math.round(columns)) })) query.set(key, String(value));
  return rowsOf(await (await ask(`/api/records/${id}/view?${query}`)).arrayBuffer());
}

/** Series over a span: time, then a row each; NaN breaks a line, infinity says "no sample here". */
export const filters = (log: string, values: Record<string, number>) => json<FilterScreen>(`/api/filters/${log}`, sent("POST", { values }));
export const drafts = () => json<Drafts>("/api/drafts");
export const keepDraft = (typed: PlacedDraft) => json<PlacedDraft>("/api/drafts", sent("POST", typed));
export const layouts = () => json<PlotLayout[]>("/api/layouts");
export const keepLayout = (layout: PlotLayout) => json<PlotLayout[]>("/api/layouts", sent("POST", layout));
export const removeLayout = (name: string) => json<PlotLayout[]>(`/api/layouts/${encodeURIComponent(name)}`, { method: "DELETE" });
/** Whether a formula of fields can be plotted; a refusal says why not. */
export const formula = (log: string, text: string) => json<FormulaUnit>(`/api/logs/${log}/formula?text=${encodeURIComponent(text)}`);
export async function view(
  log: string,
  series: string[],
  span: [number, number],
  columns: number,
): Promise<Float64Array[]> {
  const query = new URLSearchParams();
  for (const name of series) query.append("series", name);
  query.set("start_s", String(span[0]));
  query.set("stop_s", String(span[1]));
  query.set("columns", String(Math.max(10, Math.round(columns))));
  return rowsOf(await (await ask(`/api/logs/${log}/view?${query}`)).arrayBuffer());
}

function rowsOf(bytes: ArrayBuffer): Float64Array[] {
  const [points, rows] = new Float64Array(bytes, 0, 2);
  return Array.from({ length: rows }, (_, row) => new Float64Array(bytes, 16 + row * points * 8, points));
}
