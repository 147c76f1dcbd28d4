// Panels side by side come one below another on a phone, on the page as in a report.
import assert from "node:assert/strict";
import { test } from "node:test";

const { stack } = await import("../../app/src/lib/stack.ts");

const beside = () => ({
  height: 400, margin: { t: 40, b: 60 }, legend: { y: 1.1 },
  xaxis: { domain: [0, 0.44], anchor: "y" }, xaxis2: { domain: [0.56, 1], anchor: "y2" },
  yaxis: { domain: [0, 1], anchor: "x", title: { text: "imaginary" } }, yaxis2: { domain: [0, 1], anchor: "x2" },
  annotations: [{ xref: "paper", yref: "paper", x: 0.78, y: 1 }],
});

test("each panel has the whole width and the height that it had, and the title that served both", () => {
  const layout = beside();
  assert.equal(stack(layout, 0), true);
  assert.deepEqual([layout.xaxis.domain, layout.xaxis2.domain], [[0, 1], [0, 1]]);
  const inner = layout.height - 100;
  assert.equal(inner, 2 * 300 + 80);
  const spans = [layout.yaxis, layout.yaxis2].map(({ domain }) => domain.map((each) => Math.round(each * inner)));
  assert.deepEqual(spans, [[380, 680], [0, 300]]);
  assert.equal(layout.yaxis2.title.text, "imaginary");
  assert.deepEqual([layout.annotations[0].x, Math.round(layout.annotations[0].y * inner)], [0.5, 300]);
  assert.equal(Math.round((layout.legend.y - 1) * inner), 30, "the legend stays where it was above the first");
});

test("one column stays as it is", () => {
  const layout = beside();
  delete layout.xaxis2;
  delete layout.yaxis2;
  assert.equal(stack(layout, 0), false);
  assert.equal(layout.height, 400);
});
