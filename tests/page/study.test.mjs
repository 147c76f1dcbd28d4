// A study that somebody deletes while the page is on it: its words stay, and can be written again.
import assert from "node:assert/strict";
import { test } from "node:test";

const kept = {};
globalThis.standIns["./drafts"] = { drafts: { kept: (place) => kept[place] ?? null, keep: (place, draft) => (kept[place] = draft), drop: (place) => delete kept[place] } };
const folder = { text: "[study]\n", stored: [], lack: "" };
const told = (text) => ({ text, etag: `"${text.length}"`, settings: {}, undoable: false, redoable: false, lack: folder.lack });
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
  [folder.text, folder.lack] = ["[study]\n", ""];
  const study = new Study("a");
  await study.load();
  folder.text = null;
  return study;
}

test("a whole text that was typed stays, and is written again where nothing stands", async () => {
  const study = await deleted();
  assert.equal(await study.replace("[study]\ntitle = 'mine'\n"), false);
  assert.equal(study.file, null);
  assert.match(study.error, /not stored/);
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

test("one that cannot be read is a lack with its text: keys change nothing, a whole text mends it", async () => {
  delete kept["study:a"];
  [folder.text, folder.lack] = ['title = "a', "the study file is no TOML: line 1"];
  const study = new Study("a");
  await study.load();
  assert.deepEqual([study.file, study.lack.lack, study.lack.text], [null, "the study file is no TOML: line 1", 'title = "a']);
  const before = folder.stored.length;
  assert.equal(await study.edit([{ path: ["plan"], value: {} }]), false);
  assert.equal(folder.stored.length, before);
  assert.match(study.error, /not stored/);
  assert.equal(kept["study:a"], undefined, "its text stands in the file");
  const tag = study.lack.etag;
  folder.lack = "";
  assert.equal(await study.replace('title = "a"'), true);
  assert.deepEqual([folder.stored.at(-1), study.lack, study.error, folder.text], [tag, null, "", 'title = "a"']);
});

test("one that stood before this page was opened is told as lost, and what was typed waits", async () => {
  kept["study:a"] = { text: "half typed", name: "", before: "" };
  [folder.text, folder.lack] = [null, ""];
  const study = new Study("a");
  await study.load();
  assert.equal(study.file, null);
  assert.match(study.lack.lack, /not in the folder/);
  assert.equal(kept["study:a"].text, "half typed");
  delete kept["study:a"];
  await study.load();
  assert.equal(study.lack, null, "thrown away, it is as if none had been");
});

test("what was kept alone goes when a study stands again; what was typed stays", async () => {
  for (const [text, left] of [["[study]\n", undefined], ["half typed", "half typed"]]) {
    const study = await deleted();
    await study.load();
    if (left) kept["study:a"] = { ...kept["study:a"], text };
    folder.text = "[study]\ntitle = 'proposed'\n";
    await study.load();
    assert.deepEqual([study.lack, study.file.text, kept["study:a"]?.text], [null, folder.text, left]);
  }
});

test("what an editor changed is read by who comes back, and nothing where it stands as it did", async () => {
  await deleted();
  folder.text = "[study]\n";
  const study = new Study("a");
  await study.load();
  const before = study.file;
  await study.reread();
  assert.equal(study.file, before);
  folder.text = "[study]\ntitle = 'by an editor'\n";
  await study.reread();
  assert.equal(study.file.text, folder.text);
});
