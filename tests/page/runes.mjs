// Lets Node import the modules of the page: types come off, runes are compiled, and what needs a
// browser or a server is taken from the stand-ins that a test puts into globalThis.standIns.
import { readFileSync } from "node:fs";
import { createRequire, registerHooks, stripTypeScriptTypes } from "node:module";
import { fileURLToPath } from "node:url";

const PAGE = new URL("../../app/", import.meta.url);
const svelte = createRequire(new URL("package.json", PAGE));
const { compileModule } = svelte("svelte/compiler");
globalThis.standIns = {};

registerHooks({
  resolve(asked, context, next) {
    if (asked in globalThis.standIns) return { url: `stand-in:${asked}`, shortCircuit: true };
    if (asked.startsWith("svelte")) return next(asked, { ...context, parentURL: new URL("package.json", PAGE).href, conditions: ["browser", "import", "default"] });
    if (asked.startsWith("./") && context.parentURL?.startsWith(PAGE.href) && !context.parentURL.includes("node_modules")) {
      return { url: new URL(`${asked}.ts`, context.parentURL).href, shortCircuit: true };
    }
    return next(asked, context);
  },
  load(url, context, next) {
    if (url.startsWith("stand-in:")) {
      const name = url.slice("stand-in:".length);
      const names = Object.keys(globalThis.standIns[name]);
      const source = names.map((each) => `export const ${each} = globalThis.standIns[${JSON.stringify(name)}].${each};`).join("\n");
      return { format: "module", source, shortCircuit: true };
    }
    if (!url.endsWith(".svelte.ts")) return next(url, context);
    const filename = fileURLToPath(url);
    const plain = stripTypeScriptTypes(readFileSync(filename, "utf-8"), { mode: "transform" });
    return { format: "module", source: compileModule(plain, { filename, generate: "client" }).js.code, shortCircuit: true };
  },
});
