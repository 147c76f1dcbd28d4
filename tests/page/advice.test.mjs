// What to do, with screens in place of commands of the terminal.
import assert from "node:assert/strict";
import { test } from "node:test";

globalThis.standIns["./forms"] = { FORMS: {} };
const { adviceParts, here } = await import("../../app/src/lib/advice.svelte.ts");
const said = (text) => adviceParts(text, "a", ["gains", "plan"]).map((each) => each.text).join("");

test("inputs that no screen of a rig designs are told without the command, those of a log lead to Plan", () => {
  const text = "move the inputs more, over a decade of frequencies: flightid design plans it";
  here.ofRig = true;
  assert.equal(said(text), "move the inputs more, over a decade of frequencies");
  here.ofRig = false;
  assert.equal(said(text), "move the inputs more, over a decade of frequencies: Plan plans it");
});
