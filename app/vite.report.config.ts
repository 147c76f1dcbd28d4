import { defineConfig } from "vite";

// The one script of reports that is bundled: it is kept beside their templates, the same bytes for the same lock.
export default defineConfig({
  publicDir: false,
  build: {
    outDir: "../src/flightid/report/templates",
    emptyOutDir: false,
    target: "es2020",
    lib: { entry: "src/report/gunzip.ts", formats: ["iife"], name: "gunzip", fileName: () => "gunzip.js" },
  },
});
