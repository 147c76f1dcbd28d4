// Typed numbers: what is refused stands with its range, and nothing is heard that no field shows.
import assert from "node:assert/strict";
import { test } from "node:test";

const { Typed, judged } = await import("../../app/src/lib/typed.svelte.ts");
const band = { names: ["Lowest", "Highest"], values: [0.28, 6.3], ranges: [[0.1, 12], [0.1, 12]], unit: "Hz" };

function typed(rule, said = () => "") {
  const heard = [];
  const made = new Typed(() => rule, (values) => { heard.push(values); return said(); });
  return { made, heard };
}

test("a crossed end stands, marked, with the range; nobody hears of it", async () => {
  const { made, heard } = typed(band);
  await made.type(0, "9");
  assert.equal(made.text(0), "9");
  assert.deepEqual([made.wrong(0), made.wrong(1)], [true, false]);
  assert.equal(made.why, "Lowest has to be below Highest, and each 0.1 to 12 Hz; 0.28 to 6.3 Hz stands.");
  await made.type(1, "500");
  assert.deepEqual([made.text(0), made.text(1)], ["9", "500"]);
  assert.match(made.why, /^Highest may be 0.1 to 12 Hz; /);
  assert.deepEqual(heard, []);
  await made.type(1, "11");
  assert.deepEqual(heard, [[9, 11]]);
  assert.equal(made.why, "");
});

test("a good end beside a refused one waits for it, and both are taken together", async () => {
  const { made, heard } = typed({ ...band, values: [null, null], usual: [0.1, 12], empty: true });
  await made.type(0, "500");
  await made.type(1, "10");
  assert.deepEqual(heard, []);
  assert.match(made.why, /^Lowest may be 0.1 to 12 Hz; 0.1 to 12 Hz stands/);
  await made.type(0, "2");
  assert.deepEqual(heard, [[2, 10]]);
});

test("an end that is not typed is the usual one, an emptied one is left out", async () => {
  const { made, heard } = typed({ ...band, values: [null, null], usual: [0.1, 12], empty: true });
  await made.type(0, "2");
  assert.deepEqual(heard.pop(), [2, 12]);
  await made.type(0, "");
  assert.deepEqual(heard.pop(), [null, 12]);
});

test("ranges are told as they are, and empty, fractions and words are refused where they are none", () => {
  const one = (more, text) => judged({ names: ["N"], values: [5], ranges: [[1, 20]], ...more }, [text]).why;
  assert.equal(one({}, "20"), "");
  assert.equal(one({}, ""), "N cannot be left out, and may be 1 to 20; 5 stands.");
  assert.equal(one({ empty: true }, ""), "");
  assert.match(one({ whole: true }, "2.5"), /^N may be a whole number, 1 to 20;/);
  assert.match(one({ ranges: [[0, Infinity]], above: true, unit: "s" }, "0"), /^N may be above 0 s;/);
  assert.match(one({}, "?"), /^N may be 1 to 20;/);
  assert.equal(one({ ranges: [[1.0004, 20.004]], print: (each) => each.toFixed(1) }, "20"), "");
  assert.equal(judged({ names: ["N"], values: [5], ranges: [[1, 20.004]], print: (each) => each.toPrecision(3) }, ["20.0"]).values[0], 20);
});

test("what a study refuses stays with its reason, what comes anew takes its place", async () => {
  const { made } = typed(band, () => "The study refuses it.");
  await made.type(0, "1");
  assert.deepEqual([made.text(0), made.why, made.wrong(0)], ["1", "The study refuses it.", true]);
  made.came();
  assert.deepEqual([made.text(0), made.why, made.wrong(0)], ["0.28", "", false]);
});
