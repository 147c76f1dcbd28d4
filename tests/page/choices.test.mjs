// What is chosen of a rig's records stays until a study holds it, and a foreign file harms nobody.
import assert from "node:assert/strict";
import { test } from "node:test";

let kept = {};
globalThis.standIns["./drafts"] = {
  drafts: {
    kept: (place) => kept[place] ?? null,
    keep: (place, draft) => (kept[place] = draft),
    drop: (place) => delete kept[place],
  },
};
const { Choices } = await import("../../app/src/lib/choices.svelte.ts");

test("roles, units, grid and model are there again for the next window", () => {
  kept = {};
  const first = new Choices("a");
  first.keep();
  assert.deepEqual(kept, {}, "nothing is chosen");
  first.roles.drive = "input";
  first.units.drive = "V";
  first.grid = 0.01;
  first.template = "rate_first_order";
  first.keep();
  assert.deepEqual(Object.keys(kept), ["records:a"]);
  const next = new Choices("a");
  assert.deepEqual([next.roles.drive, next.units.drive, next.grid, next.template, next.again], ["input", "V", 0.01, "rate_first_order", true]);
  assert.equal(new Choices("b").bare, true, "of other records nothing");
  next.written();
  assert.deepEqual(kept, {});
  assert.equal(next.roles.drive, "input");
  next.discard();
  assert.equal(next.bare, true);
});

test("what does not fit is passed over", () => {
  for (const text of ["", "null", "[1]", '{"roles": {"a": "pilot", "b": "output"}, "units": 3, "servos": {"a": "fast"}, "grid": "1", "bridges": [1]}']) {
    kept = { "records:a": { text, name: "", before: "" } };
    const made = new Choices("a");
    assert.deepEqual({ ...made.roles }, text.includes("pilot") ? { b: "output" } : {});
    assert.deepEqual([made.grid, made.bridges.length, Object.keys(made.servos).length], [null, 0, 0]);
  }
});
