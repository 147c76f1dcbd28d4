import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig } from "vite";

// The page lies in the package: a few files without hashes, the same bytes for the same sources.
export default defineConfig({
  plugins: [svelte()],
  build: {
    outDir: "../src/flightid/app/page",
    emptyOutDir: true,
    target: "es2022",
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 600, // kB: three.js, fetched by the screen Fly alone
    rollupOptions: {
      output: {
        entryFileNames: "page.js",
        chunkFileNames: "[name].js",
        assetFileNames: "[name][extname]",
      },
    },
  },
});
