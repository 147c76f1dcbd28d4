// A study that somebody deletes while the page is on it: its words stay, and can be written again.
import assert from "node:assert/strict";
import { test } from "node:test";

const kept = {};
globalThis.standIns["./drafts"] = { drafts: { kept: (place) => kept[place] ?? null, keep: (place, draft) => (kept[place] = draft), drop: (place) => delete kept[place] } };
const folder = { text: "[study]\n", stored: [], lack: "", last: null, asked: [], merged: null };
const told = (text) => ({ text, etag: `"${text.length}"`, settings: {}, undoable: 0, redoable: 0, state: folder.lack ? "unreadable" : "readable", lack: folder.lack });
/** The server, which remembers what stood last; of another study than the one it knows of it tells nothing. */
const known = () => (folder.text !== null ? told(folder.text) : folder.last === null ? null : { ...told(folder.last), etag: '""', state: "lost", lack: "not in the folder" });
function store(etag, text) {
  folder.stored.push(etag);
  if (folder.text === null && etag !== '""') throw Object.assign(new Error("This log has no study."), { status: 404 });
  if (folder.text !== null && etag !== told(folder.text).etag) throw Object.assign(new Error("changed"), { status: 409 });
  if (text.startsWith("slip")) throw Object.assign(new Error("no TOML"), { status: 422 });
  folder.lack = "";
  return told((folder.text = text));
}
globalThis.standIns["./api"] = {
  study: async () => known(),
  change: async (_, etag) => store(etag, "changed"),
  replace: async (_, etag, text) => store(etag, text),
  step: async () => {},
  merge: async (_, two) => (folder.asked.push(two), { mine: two.mine, merged: folder.merged, why: "", lines: [] }),
};
const { Study } = await import("../../app/src/lib/study.svelte.ts");

/** A page on a study that stands so; then the file is as an editor leaves it. */
async function opened(before, after, { lack = "", remembers = false, typed = "" } = {}) {
  delete kept["study:a"];
  Object.assign(folder, { text: before, lack: "", last: null, stored: [], asked: [], merged: null });
  const study = new Study("a");
  await study.load();
  if (typed) study.type(typed);
  Object.assign(folder, { text: after, lack, last: remembers ? before : null });
  return study;
}

test("a text that was typed stays, and is written again where nothing stands", async () => {
  for (const remembers of [false, true]) {
    const study = await opened("[study]\n", null, { remembers, typed: "mine" });
    assert.equal(await study.save(), false);
    assert.deepEqual([study.file, study.lack.text, study.typed.text, kept["study:a"].text], [null, "[study]\n", "mine", "mine"]);
    assert.match(study.error, /not stored/);
    assert.equal(await study.save(), true);
    assert.deepEqual([folder.stored.at(-1), folder.text, study.typed, kept["study:a"]], ['""', "mine", null, undefined]);
  }
});

test("a click, a focus and a reload say that it is lost, show its text, and call nothing typed", async () => {
  for (const remembers of [false, true])
    for (const look of [(study) => study.edit([{ path: ["plan"], value: {} }]), (study) => study.reread(), (study) => study.load()]) {
      const study = await opened("[study]\n", null, { remembers });
      await look(study);
      assert.deepEqual([study.file, study.lack.text, study.typed, kept["study:a"]], [null, "[study]\n", null, undefined]);
      folder.text = "[study]\n";
      await study.reread();
      assert.deepEqual([study.lack, study.file.text, study.typed], [null, "[study]\n", null]);
    }
});

test("one that cannot be read is a lack with its text: a click changes nothing, the same text neither", async () => {
  const study = await opened("[study]\n", "slip", { lack: "no TOML" });
  await study.reread();
  assert.deepEqual([study.file, study.lack.lack, study.lack.text, study.typed], [null, "no TOML", "slip", null]);
  assert.equal(await study.edit([{ path: ["plan"], value: {} }]), false);
  assert.deepEqual(folder.stored, []);
  assert.equal(await study.save(), false);
  assert.match(study.error, /^Not written: no TOML/);
  assert.deepEqual([study.file, study.lack.text], [null, "slip"]);
  study.type("mended");
  assert.equal(await study.save(), true);
  assert.deepEqual([folder.text, study.lack, study.typed, kept["study:a"]], ["mended", null, null, undefined]);
});

test("an answer that cannot be read is a lack, whoever asked", async () => {
  const study = await opened("[study]\n", "slip", { lack: "no TOML" });
  globalThis.standIns["./api"].step = async () => told(folder.text);
  await study.reread();
  assert.deepEqual([study.file, study.lack.text], [null, "slip"]);
});

test("other words than those typed over are asked about, readable or not, seen before or not", async () => {
  for (const lack of ["", "no TOML"])
    for (const seen of [true, false]) {
      const study = await opened("base", "of an editor", { lack, typed: "mine" });
      if (seen) await study.reread();
      if (seen) assert.equal(study.moved, true);
      const saved = study.save();
      while (!study.conflict) await new Promise((go) => setTimeout(go));
      assert.deepEqual([folder.asked.at(-1).base, folder.asked.at(-1).theirs, folder.asked.at(-1).mine], ["base", "of an editor", "mine"]);
      assert.equal(folder.text, "of an editor");
      await study.settle("later");
      assert.equal(await saved, false);
      assert.deepEqual([folder.text, study.typed.text, study.typed.before], ["of an editor", "mine", "base"]);
      const again = study.save();
      while (!study.conflict) await new Promise((go) => setTimeout(go));
      await study.settle("mine");
      assert.equal(await again, true);
      assert.deepEqual([folder.text, study.typed, kept["study:a"]], ["mine", null, undefined]);
    }
});

test("a click that waits is among the words that are typed, else the study's value is shown again", async () => {
  const { unstored } = await import("../../app/src/lib/stands.svelte.ts");
  for (const [merged, text, why] of [["mine, 77", "mine, 77", /^$/], [null, "mine", /was not made/]]) {
    const study = await opened("base", "of an editor", { typed: "mine" });
    const times = unstored.times;
    const clicked = study.edit([{ path: ["n"], value: 77 }]);
    while (!study.conflict) await new Promise((go) => setTimeout(go));
    study.conflict = { ...study.conflict, mine: "base, 77" };
    folder.merged = merged;
    await study.settle("later");
    assert.equal(await clicked, false);
    assert.deepEqual(folder.asked.at(-1), { base: "base", mine: "base, 77", theirs: "mine", edits: [] });
    assert.deepEqual([folder.text, study.typed.text, study.typed.before, kept["study:a"].text], ["of an editor", text, "base", text]);
    assert.match(study.error, why);
    assert.equal(unstored.times, times + 1);
  }
});

test("an emptied study is a text that stands, and one that cannot be read keeps the screens of what it was", async () => {
  const study = await opened("[study]\n", "", { lack: "no model" });
  await study.reread();
  assert.deepEqual([study.stands, study.lack.text, study.models.length, study.lackedModels], [true, "", 0, false]);
  const unseen = new Study("a");
  await unseen.load();
  assert.equal(unseen.lackedModels, true);
});

test("words of nobody's typing are no draft, and those of a page before are taken up", async () => {
  await opened("base", "base");
  for (const [text, before, left] of [["base", "older", null], ["older", "older", null], ["mine", "older", "mine"]]) {
    kept["study:a"] = { text, name: "", before };
    const study = new Study("a");
    await study.load();
    assert.deepEqual([study.typed?.text ?? null, study.again, kept["study:a"]?.text ?? null], [left, left !== null, left]);
    study.discard();
  }
});

test("one that stood before this page was opened is told as lost, and what was typed waits", async () => {
  await opened("base", null);
  kept["study:a"] = { text: "half typed", name: "", before: "" };
  const study = new Study("a");
  await study.load();
  assert.equal(study.file, null);
  assert.match(study.lack.lack, /not in the folder/);
  assert.equal(study.typed.text, "half typed");
  study.discard();
  assert.equal(study.lack, null, "thrown away, it is as if none had been");
});

test("what an editor changed is read by who comes back, and nothing where it stands as it did", async () => {
  const study = await opened("[study]\n", "[study]\n");
  const before = study.file;
  await study.reread();
  assert.equal(study.file, before);
  folder.text = "[study]\ntitle = 'by an editor'\n";
  await study.reread();
  assert.equal(study.file.text, folder.text);
});
