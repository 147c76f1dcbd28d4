// Numbers of one kind have one number of digits.
import assert from "node:assert/strict";
import { test } from "node:test";

const { kept } = await import("../../app/src/lib/digits.ts");

test("a number keeps the zeros that it is known with", () => {
  assert.deepEqual([16, 15.7, 0.5, 0.00123, 59.96, 1234].map((each) => kept(each, 3)), ["16.0", "15.7", "0.500", "0.00123", "60.0", "1230"]);
  assert.equal(kept(0, 3), "0");
  assert.equal(kept(5.9912, 4), "5.991");
});
