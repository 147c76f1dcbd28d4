// A study that somebody deletes while the page is on it: its words stay, and can be written again.
import assert from "node:assert/strict";
import { test } from "node:test";

const kept = {};
globalThis.standIns["./drafts"] = { drafts: { kept: (place) => kept[place] ?? null, keep: (place, draft) => (kept[place] = draft), drop: (place) => delete kept[place] } };
const folder = { text: "[study]\n", stored: [] };
const told = (text) => ({ text, etag: `"${text.length}"`, settings: {}, undoable: false, redoable: false });
function store(etag, text) {
  folder.stored.push(etag);
  if (folder.text === null && etag !== '""') throw Object.assign(new Error("This log has no study."), { status: 404 });
  return told((folder.text = text));
}
globalThis.standIns["./api"] = {
  study: async () => (folder.text === null ? null : told(folder.text)),
  change: async (_, etag) => store(etag, "changed"),
  replace: async (_, etag, text) => store(etag, text),
  step: async () => {},
  merge: async () => ({}),
};
const { Study } = await import("../../app/src/lib/study.svelte.ts");

async function deleted() {
  delete kept["study:a"];
  folder.text = "[study]\n";
  const study = new Study("a");
  await study.load();
  folder.text = null;
  return study;
}

test("a whole text that was typed stays, and is written again where nothing stands", async () => {
  const study = await deleted();
  assert.equal(await study.replace("[study]\ntitle = 'mine'\n"), false);
  assert.equal(study.file, null);
  assert.match(study.error, /deleted meanwhile: nothing was stored/);
  assert.equal(kept["study:a"].text, "[study]\ntitle = 'mine'\n");
  assert.equal(await study.replace(kept["study:a"].text), true);
  assert.equal(folder.stored.at(-1), '""');
  assert.equal(folder.text, "[study]\ntitle = 'mine'\n");
});

test("a click, and a reading of what is gone, keep the text as it was last shown", async () => {
  const study = await deleted();
  assert.equal(await study.edit([{ path: ["plan"], value: {} }]), false);
  assert.equal(kept["study:a"].text, "[study]\n");
  const other = await deleted();
  await other.load();
  assert.equal(kept["study:a"].text, "[study]\n");
  assert.equal(other.file, null);
});

test("what waits already as typed text is not overwritten", async () => {
  const study = await deleted();
  kept["study:a"] = { text: "half typed", name: "", before: "[study]\n" };
  await study.edit([{ path: ["plan"], value: {} }]);
  assert.equal(kept["study:a"].text, "half typed");
});
