// Read the texts in the lines of standard input (JSON), and write what the reader makes of each as a line of JSON;
// with the argument `verdicts`, without the models.

import { createInterface } from "node:readline";

import { read } from "../../cinegen/page/static/raff/read.js";

/** @param {import("../../cinegen/page/static/raff/problems.js").Problem} problem */
function plain(problem) {
  const { message, location } = problem;
  return { message, at: location ? [location.line, location.column, location.length] : null, text: String(problem) };
}

for await (const line of createInterface({ input: process.stdin })) {
  const text = JSON.parse(line);
  const began = process.cpuUsage();
  const { models, errors, warnings } = read(text);
  const { user, system } = process.cpuUsage(began);
  const took = (user + system) / 1000; // ms
  const result = { models: process.argv[2] === "verdicts" ? [] : models, errors: errors.map(plain), warnings: warnings.map(String), took };
  const finite = (/** @type {string} */ _, /** @type {unknown} */ value) =>
    typeof value === "number" && !Number.isFinite(value) ? String(value) : value;
  process.stdout.write(`${JSON.stringify(result, finite)}\n`);
}
