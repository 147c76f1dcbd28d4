/** Formulas of model files as MathML: fractions, subscripts, Greek letters, dots. */
type Node = { kind: "number" | "name"; text: string } | { kind: "call"; text: string; inner: Node[] } | { kind: "binary"; text: string; left: Node; right: Node } | { kind: "minus"; inner: Node };

const GREEK: Record<string, string> = {
  alpha: "α", beta: "β", gamma: "γ", delta: "δ", epsilon: "ε", zeta: "ζ", eta: "η", theta: "θ", iota: "ι", kappa: "κ", lambda: "λ", mu: "μ", nu: "ν", xi: "ξ", rho: "ρ", sigma: "σ", tau: "τ",
  phi: "φ", chi: "χ", psi: "ψ", omega: "ω", Gamma: "Γ", Delta: "Δ", Theta: "Θ", Lambda: "Λ", Xi: "Ξ", Sigma: "Σ", Phi: "Φ", Psi: "Ψ", Omega: "Ω",
};
const LETTERS = Object.keys(GREEK).sort((a, b) => b.length - a.length).join("|");
const WHOLE = new RegExp(`^([A-Za-z]?)(${LETTERS})(dot)?(\\d*)$`);
const FIRST = new RegExp(`^(${LETTERS}|[A-Za-z])_?(.*)$`);
const LEVEL: Record<string, number> = { "+": 1, "-": 1, "*": 2, "/": 2, "^": 4 };

const safe = (text: string) => text.replace(/[&<>"]/g, (each) => `&#${each.charCodeAt(0)};`);
const mi = (text: string) => `<mi>${safe(text)}</mi>`;

function subscript(text: string): string {
  const found = WHOLE.exec(text);
  if (!found) return text.replace(/_/g, ",");
  return found[1] + GREEK[found[2]] + (found[3] ? "\u0307" : "") + found[4];
}

/** A name as it is drawn: its first letter, the rest below it, a dot for each prime. */
export function name(text: string): string {
  const primes = /'*$/.exec(text)![0].length;
  const bare = text.slice(0, text.length - primes);
  let base: string;
  let below = "";
  if (/^[a-z]{4,}$/.test(bare) && !GREEK[bare]) base = bare;
  else {
    const parts = FIRST.exec(bare);
    base = parts ? (GREEK[parts[1]] ?? parts[1]) : bare;
    below = parts ? subscript(parts[2]) : "";
  }
  const letter = mi(base + (primes ? (primes > 1 ? "\u0308" : "\u0307") : ""));
  return below ? `<msub>${letter}<mtext>${safe(below)}</mtext></msub>` : letter;
}

function parse(text: string): Node {
  const tokens = text.match(/[A-Za-z_][A-Za-z0-9_]*'*|\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?|\*\*|[-+*/^(),]/g) ?? [];
  if (tokens.join("") !== text.replace(/\s+/g, "")) throw new Error("not of the grammar");
  let at = 0;
  const next = () => tokens[at++];
  function sum(least: number): Node {
    let left: Node;
    if (tokens[at] === "-") {
      next();
      left = { kind: "minus", inner: sum(2) };
    } else if (tokens[at] === "+") {
      next();
      left = sum(2);
    } else left = atom();
    while (at < tokens.length) {
      const sign = tokens[at] === "**" ? "^" : tokens[at];
      const level = LEVEL[sign];
      if (level === undefined || level < least) break;
      next();
      left = { kind: "binary", text: sign, left, right: sum(sign === "^" ? level : level + 1) };
    }
    return left;
  }
  function atom(): Node {
    const token = next();
    if (token === undefined) throw new Error("ends early");
    if (token === "(") {
      const inner = sum(1);
      if (next() !== ")") throw new Error("a bracket is open");
      return inner;
    }
    if (/^[\d.]/.test(token)) return { kind: "number", text: token };
    if (!/^[A-Za-z_]/.test(token)) throw new Error("no operand");
    if (tokens[at] !== "(") return { kind: "name", text: token };
    next();
    const inner: Node[] = [sum(1)];
    while (tokens[at] === ",") {
      next();
      inner.push(sum(1));
    }
    if (next() !== ")") throw new Error("a bracket is open");
    return { kind: "call", text: token, inner };
  }
  const made = sum(1);
  if (at < tokens.length) throw new Error("goes on");
  return made;
}

const level = (node: Node) => (node.kind === "binary" ? (node.text === "/" ? 3 : LEVEL[node.text]) : node.kind === "minus" ? 1 : 5);
const within = (node: Node, least: number) => (level(node) < least ? `<mrow><mo>(</mo>${draw(node)}<mo>)</mo></mrow>` : draw(node));

function draw(node: Node): string {
  switch (node.kind) {
    case "number": return `<mn>${node.text}</mn>`;
    case "name": return name(node.text);
    case "minus": return `<mrow><mo>−</mo>${within(node.inner, 2)}</mrow>`;
    case "call": {
      const inner = node.inner.map(draw).join("<mo>,</mo>");
      return node.text === "sqrt" ? `<msqrt>${inner}</msqrt>` : `<mrow><mi>${node.text}</mi><mo>(</mo>${inner}<mo>)</mo></mrow>`;
    }
    case "binary": {
      const { left, right } = node;
      if (node.text === "/") return `<mfrac><mrow>${draw(left)}</mrow><mrow>${draw(right)}</mrow></mfrac>`;
      if (node.text === "^") return `<msup><mrow>${within(left, 5)}</mrow><mrow>${draw(right)}</mrow></msup>`;
      if (node.text === "*") return `<mrow>${within(left, 2)}<mspace width="0.18em"/>${right.kind === "number" ? "<mo>·</mo>" : ""}${within(right, 2)}</mrow>`;
      return `<mrow>${within(left, 1)}<mo>${node.text === "-" ? "−" : "+"}</mo>${within(right, node.text === "-" ? 2 : 1)}</mrow>`;
    }
  }
}

/** Two sides as MathML; what is outside the grammar stays as it is written. */
export function equation(left: string, right: string, delay = ""): string {
  const side = (text: string) => {
    try {
      return draw(parse(text));
    } catch {
      return `<mtext>${safe(text)}</mtext>`;
    }
  };
  const exponent = /^[A-Za-z_]\w*$/.test(delay) ? side(delay) : `<mo>(</mo>${side(delay)}<mo>)</mo>`;
  const late = delay ? `<mspace width="0.18em"/><msup><mi>e</mi><mrow><mo>−</mo>${exponent}<mi>s</mi></mrow></msup>` : "";
  return `<math display="block"><mrow>${side(left)}<mo>=</mo>${side(right)}${late}</mrow></math>`;
}
