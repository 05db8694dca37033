// Rules of typescript-eslint that know the types, no circles among files, and folders that import in one direction.

import eslint from "@eslint/js";
import { createNodeResolver, importX } from "eslint-plugin-import-x";
import tseslint from "typescript-eslint";

/** Each may import from those before it. Files beside these folders and beside this list (main, viewer) may import all. */
const ORDER = ["net", "store.ts", "control.ts", "scene", "input", "ui"];

const directions = ORDER.map((place, i) => ({
  files: [place.endsWith(".ts") ? `src/${place}` : `src/${place}/**`],
  rules: {
    "no-restricted-imports": [
      "error",
      {
        patterns: [
          {
            regex: `/(${[...ORDER.slice(i + 1), "viewer", "test_hooks", "main"].map((name) => name.replace(".ts", "")).join("|")})(/|$)`,
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
    plugins: { "import-x": importX },
    settings: {
      "import-x/resolver-next": [createNodeResolver({ extensions: [".ts", ".js"] })],
      "import-x/extensions": [".ts", ".js"],
      "import-x/parsers": { "@typescript-eslint/parser": [".ts"] },
    },
    rules: {
      "import-x/no-cycle": "error",
      "@typescript-eslint/consistent-type-imports": "error",
      "@typescript-eslint/switch-exhaustiveness-check": "error",
    },
  },
  ...directions,
  { ignores: ["eslint.config.js"] },
);
