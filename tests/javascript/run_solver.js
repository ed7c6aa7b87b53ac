// Ask a page's solver, see tests/page/test_page_solver.py: node run_solver.js FILE. The file holds { module, tables, dt, calls }; a
// call is { q, tasks, ticks, gain, damping }. The results go to standard output: of each tick its status and configuration,
// then the singular values.

import { readFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";

import "./browser.js";

const { KernelSolver } = await import("../../cinegen/page/static/session/solver.js");
const { kernelsOf } = await import("../../cinegen/page/static/session/memory.js");
const { module, tables, dt, calls } = JSON.parse(await readFile(process.argv[2], "utf8"));
const solver = new KernelSolver(kernelsOf(await import(pathToFileURL(module)), tables));
const results = calls.map(({ q, tasks, ticks, gain, damping }) => {
  const at = Float64Array.from(q);
  const steps = Array.from({ length: ticks }, () => {
    const { status, errors, saturated, closure } = solver.tick(at, tasks, { dt, gain, damping });
    return { status, errors, saturated, closure, q: [...at] };
  });
  return { steps, ...solver.sigma(at, tasks) };
});
process.stdout.write(JSON.stringify(results));
