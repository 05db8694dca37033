import { defineConfig } from "vite";

// The Python server sends these files as they are; it may stand under any path, hence the relative base.
export default defineConfig({
  base: "./",
  // Messages that the tests take in.
  assetsInclude: ["**/*.bin"],
  build: {
    outDir: "../python/palpate/viewer/static",
    emptyOutDir: true,
    target: "es2022",
    // The page allows no inline script, and every browser with WebGL 2 preloads modules by itself.
    modulePreload: { polyfill: false },
    // three alone is above vite's default; a larger page than this would be a mistake.
    chunkSizeWarningLimit: 800,
  },
});
