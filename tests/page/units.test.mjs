// Units of a rig's columns: none is said of a column without a role, and no empty table stays.
import assert from "node:assert/strict";
import { test } from "node:test";

globalThis.standIns["./drafts"] = { drafts: { kept: () => null, keep: () => {}, drop: () => {} } };
const { Choices } = await import("../../app/src/lib/choices.svelte.ts");
const { only, unitEdits } = await import("../../app/src/lib/unitEdits.ts");

test("a unit that is taken back is none, and of a column left out none is sent", () => {
  const choices = new Choices("a");
  choices.measured(["temperature", "drive"], "degC");
  choices.measured(["drive"], "");
  assert.deepEqual(Object.keys(choices.units), ["temperature"]);
  assert.deepEqual(only({ temperature: "degC", drive: "V", rate: "" }, ["drive", "rate"]), { drive: "V" });
});

test("the last unit of a table takes the table with it", () => {
  const place = ["defaults", "record", "units"];
  assert.deepEqual(unitEdits(["a"], "", { a: "V" }, []), [{ path: place, value: null }]);
  assert.deepEqual(unitEdits(["a"], "", { a: "V", b: "V" }, []), [{ path: [...place, "a"], value: null }]);
  assert.deepEqual(unitEdits(["a"], "", undefined, [{}]), []);
  assert.deepEqual(unitEdits(["a"], "mV", { a: "V" }, [{ units: { a: "V" } }, { units: { a: "V", b: "V" } }]), [
    { path: ["record", 0, "units"], value: null },
    { path: ["record", 1, "units", "a"], value: null },
    { path: [...place, "a"], value: "mV" },
  ]);
});
