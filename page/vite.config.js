import { defineConfig } from "vite";

// Into the Python package, from where the service answers: the page, and the API's description.
// Paths are relative, so that it may stand behind any prefix.
export default defineConfig({
  base: "./",
  build: {
    outDir: "../service/page",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 2000,
    rolldownOptions: { input: ["index.html", "docs.html"] },
  },
  worker: { format: "es" },
});
