// Rules of typescript-eslint that know the types, and folders that import in one direction. Circles among files of one
// folder are found by `src/imports.test.ts`. Rules with types ask the compiler, which TypeScript 7 offers no interface for:
// hence TypeScript 6.

import eslint from "@eslint/js";
import tseslint from "typescript-eslint";

/** Each may import from those before it. Files beside these folders and beside this list (main, viewer) may import all. */
const ORDER = ["net", "regions.ts", "window_regions.ts", "store.ts", "control.ts", "painting.ts", "scene", "input", "ui"];

const directions = ORDER.map((place, i) => ({
  files: [place.endsWith(".ts") ? `src/${place}` : `src/${place}/**`],
  rules: {
    "no-restricted-imports": [
      "error",
      {
        patterns: [
          {
            regex: `/(${[...ORDER.slice(i + 1), "viewer", "page_interface", "main"].map((name) => name.replace(".ts", "")).join("|")})(/|$)`,
            message: `imports go in one direction: ${ORDER.join(" <- ")} <- viewer.ts`,
          },
        ],
      },
    ],
  },
}));

export default tseslint.config(
  eslint.configs.recommended,
  tseslint.configs.recommendedTypeChecked,
  {
    languageOptions: { parserOptions: { projectService: true, tsconfigRootDir: import.meta.dirname } },
    rules: {
      "@typescript-eslint/consistent-type-imports": "error",
      "@typescript-eslint/switch-exhaustiveness-check": "error",
    },
  },
  ...directions,
  // The service worker of static pages is no module of the page.
  { ignores: ["eslint.config.js", "public/sw.js"] },
);
