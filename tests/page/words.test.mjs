// Units as a reader writes them, on the page as in the report.
import assert from "node:assert/strict";
import { test } from "node:test";

const { raised, unitOf } = await import("../../app/src/lib/unitWords.ts");

test("units of sentences have raised powers, names and formulas stay", () => {
  assert.equal(raised("K = 20 rad/s^2/V of x^2, s^20 and kg m^2"), "K = 20 rad/s²/V of x^2, s^20 and kg m²");
  assert.equal(unitOf("rad/s^2"), "rad/s²");
  assert.equal(unitOf("1"), "");
});
