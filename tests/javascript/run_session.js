// Run commands in the session of a page without a server, see tests/page/test_same_session.py: node run_session.js FILE.
// The file holds { content, modules: paths by name, script: [[ticks, command or null], ...] }; the states go to standard
// output, one after each entry.

import { readFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";

import "./browser.js";

const { robotsOf } = await import("../../cinegen/page/static/session/link.js");
const { KernelSolver } = await import("../../cinegen/page/static/session/solver.js");
const { LocalSession } = await import("../../cinegen/page/static/session/session.js");

const { content, modules, script } = JSON.parse(await readFile(process.argv[2], "utf8"));
const found = await Promise.all(content.robots.map(({ module }) => import(pathToFileURL(modules[module]))));
const solvers = found.map((module) => new KernelSolver(module.default()));
const session = new LocalSession(...robotsOf(content, solvers));
const states = script.map(([ticks, command]) => {
  if (command !== null) session.obey(command);
  for (let i = 0; i < ticks; i += 1) session.tick(1 / content.rate);
  const robots = [...session.robots.values()].map((robot) => {
    const { q, step } = robot;
    const tasks = robot.tasks.map(({ id, node, source, translation, rotation, weight }) => [id, node, source, translation, rotation, weight]);
    return [robot.name, { q: [...q], status: robot.status().name, closure: step.closure, tasks, base: robot.base.numbers() }];
  });
  const { undoCount: undo, redoCount: redo } = session.history;
  return { robots: Object.fromEntries(robots), undo, redo, paused: session.paused, moving: session.moving, notices: session.notices.length };
});
process.stdout.write(JSON.stringify(states));
