// Rules for the JavaScript of the page and its tests: ESLint's recommended ones, and a few against common mistakes.

import js from "@eslint/js";
import globals from "globals";

export default [
  { ignores: ["build/**", ".venv*/", "htmlcov/"] },
  js.configs.recommended,
  {
    linterOptions: { reportUnusedDisableDirectives: "error" },
    rules: {
      curly: ["error", "multi-line"],
      eqeqeq: "error",
      "no-var": "error",
      "prefer-const": "error",
    },
  },
  { files: ["cinegen/cockpit/static/**/*.js", "cinegen/page/static/**/*.js", "docs/site/**/*.js"], languageOptions: { globals: globals.browser } },
  { files: ["tests/javascript/**/*.js", "benchmarks/*.mjs"], languageOptions: { globals: { ...globals.node, ...globals.browser } } },
];
