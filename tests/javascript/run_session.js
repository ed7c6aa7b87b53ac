// Run commands in the session of a page without a server, see tests/page/test_same_session.py: node run_session.js FILE.
// The file holds { content, module: path of the kernels, script: [[ticks, command or null], ...] }; the states go to standard
// output, one after each entry.

import { readFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";

import "./browser.js";

const { robotsOf } = await import("../../cinegen/page/static/session/link.js");
const { KernelSolver } = await import("../../cinegen/page/static/session/solver.js");
const { LocalSession } = await import("../../cinegen/page/static/session/session.js");

const { kernelsOf } = await import("../../cinegen/page/static/session/memory.js");
const { content, module, script } = JSON.parse(await readFile(process.argv[2], "utf8"));
const kernels = await import(pathToFileURL(module));
const solvers = content.robots.map(({ tables }) => new KernelSolver(kernelsOf(kernels, tables)));
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
  const { infos: waypoints, target: waypoint } = session.waypoints;
  const { paused, moving, notices } = session;
  return { robots: Object.fromEntries(robots), undo, redo, paused, moving, waypoints, waypoint, notices: notices.length };
});
process.stdout.write(JSON.stringify(states));
