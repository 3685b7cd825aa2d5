import { defineConfig } from "vite";

// Into the Python package, from where the service answers; paths are relative, so that it may
// stand behind any prefix.
export default defineConfig({
  base: "./",
  build: {
    outDir: "../service/page",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 1000,
  },
  worker: { format: "es" },
});
