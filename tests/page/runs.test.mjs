// What a screen says of the work on its study: what goes on, and what a server that ended left undone.
import assert from "node:assert/strict";
import { test } from "node:test";

const folder = { jobs: [] };
const heard = [];
globalThis.standIns["./api"] = { lastRun: async () => ({ run: null, left_out: [], jobs: folder.jobs }), run: async () => ({ run: null, left_out: [], jobs: [job("waiting")] }) };
globalThis.standIns["./live.svelte"] = { live: { onNews: (hear) => heard.push(hear) } };
const { Runs } = await import("../../app/src/lib/runs.svelte.ts");

const job = (state) => ({ id: "run-a", kind: "run", log: "a", state, reason: "" });
async function opened(...states) {
  folder.jobs = states.map(job);
  const runs = new Runs("a");
  await runs.load();
  return runs;
}

test("a run that the end of its server cut short is offered, and goes on when it is asked for", async () => {
  const runs = await opened("interrupted");
  assert.equal(runs.waiting, false);
  assert.equal(runs.work?.state, "interrupted");
  await runs.begin();
  assert.equal(runs.work?.state, "waiting");
  runs.listen();
  folder.jobs = [];
  heard.at(-1)(job("done"));
  assert.equal(runs.work, null);
});

test("one that somebody cancelled, or that failed, is no work that waits", async () => {
  for (const state of ["cancelled", "failed"]) assert.equal((await opened(state)).work, null);
  assert.equal((await opened()).work, null);
});
