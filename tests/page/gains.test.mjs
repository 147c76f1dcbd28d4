// Whose numbers the Gains screen shows while those of its study are not there yet.
import assert from "node:assert/strict";
import { test } from "node:test";

const asked = [];
globalThis.standIns["./live.svelte"] = { live: { asker: () => (question, answer) => asked.push({ question, answer }) } };
globalThis.standIns["svelte"] = { onDestroy: () => {} };
const { Hand } = await import("../../app/src/lib/hand.svelte.ts");
const { oldNumbers, promised } = await import("../../app/src/lib/gainWords.ts");

const slider = (name, value) => ({ name, value, unit: "1", flown: value, found: value, low: 0, high: 1 });
const still = { axis: "roll", sliders: [slider("P", 0.1), slider("D", 0.004)], curves: [], is_stable: true };
const judged = { ...still, curves: [] };
function aHand() {
  asked.length = 0;
  return new Hand("log", () => still);
}

test("numbers are of the sliders from the answer of the last move on, and of no earlier one", () => {
  const hand = aHand();
  assert.equal(hand.holds, false);
  hand.move("P", 0.2);
  const [first] = asked;
  first.answer({ error: null, moved: judged });
  assert.equal(hand.holds, true);
  hand.move("P", 0.3);
  assert.equal(hand.holds, false, "the numbers shown are of P = 0.2");
  asked.at(-1).answer({ error: null, moved: judged });
  assert.equal(hand.holds, true);
  hand.stop();
});

test("an answer to what was asked before gains were found anew is of no slider", () => {
  const hand = aHand();
  hand.move("P", 0.2);
  const [late] = asked;
  hand.forget();
  late.answer({ error: null, moved: judged });
  assert.equal(hand.holds, false);
  assert.equal(hand.moved, null);
});

test("a slider that is pressed stays where it is when gains are found anew, and is judged again", () => {
  const hand = aHand();
  hand.move("P", 0.2);
  hand.pressed = true;
  hand.anew(false);
  assert.equal(hand.values.P, 0.2);
  assert.deepEqual(asked.at(-1).question.values, { P: 0.2, D: 0.004 });
  hand.pressed = false;
  hand.anew(false);
  assert.deepEqual(hand.values, {});
});

test("while another slider is held the numbers are of the sliders, not of the study before", () => {
  const hand = aHand();
  assert.equal(hand.told, null);
  hand.move("P", 0.2);
  asked.at(-1).answer({ error: null, moved: judged });
  hand.pressed = true;
  hand.move("D", 0.005);
  assert.deepEqual(hand.told, { axis: "roll", now: false });
  asked.at(-1).answer({ error: null, moved: judged });
  assert.deepEqual(hand.told, { axis: "roll", now: true });
  hand.forget();
});

test("a slider that is let go where its study has it keeps nothing of the hand", () => {
  const hand = aHand();
  hand.move("P", 0.1);
  asked.at(-1).answer({ error: null, moved: judged });
  hand.pressed = true;
  hand.anew(false);
  hand.pressed = false;
  assert.deepEqual(hand.values, {});
  assert.equal(hand.moved, null);
});

test("the banner says of each number whose it is", () => {
  const of = (preset, form = "") => ({ preset, form });
  const roll = (now) => ({ axis: "roll", now });
  assert.match(oldNumbers(of("balanced"), of("balanced"), null), /^The numbers shown are of the study before/);
  assert.match(oldNumbers(of("balanced"), of("balanced"), roll(true)), /^The numbers of roll are of its sliders as they stand; files and other axes are still/);
  assert.match(oldNumbers(of("balanced"), of("balanced"), roll(false)), /^The numbers of roll follow its sliders; files and other axes are still/);
  assert.match(oldNumbers(of("gentle"), of("firm"), roll(true)), /still those of `gentle`; `firm` has none yet/);
  const forms = { pi: "PI", pid: "PID in parallel" };
  assert.match(oldNumbers(of("firm", "pi"), of("firm", "pid"), null, forms), /`firm, PI`; `firm, PID in parallel` has none/);
});

test("where gains come from stands beside what they promise", () => {
  assert.equal(promised(true, "firm", "3 of 4 plants"), "Set by hand: 3 of 4 plants");
  assert.equal(promised(false, "firm", "3 of 4 plants"), "Found by the search, firm: 3 of 4 plants");
});
