// Random drags in the session of a page without a server: node page_session.mjs FILE, see page.py.

import { readFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";

globalThis.document = { documentElement: { dataset: {} } };
const { robotsOf } = await import("../cinegen/page/static/session/link.js");
const { LocalSession } = await import("../cinegen/page/static/session/session.js");
const { KernelSolver } = await import("../cinegen/page/static/session/solver.js");
const { stateMessage } = await import("../cinegen/page/static/session/messages.js");
const { kernelsOf } = await import("../cinegen/page/static/session/memory.js");
const { robotReport } = await import("../cinegen/page/static/session/report.js");

const TICKS = 4; // per frame: 240 a second, 60 frames
const REPORTS = 6; // frames from one report to the next

const { content, module, drags, seed } = JSON.parse(await readFile(process.argv[2], "utf8"));
const kernels = await import(pathToFileURL(module));
const session = new LocalSession(...robotsOf(content, content.robots.map(({ tables }) => new KernelSolver(kernelsOf(kernels, tables)))));
const [robot] = session.robots.values();
const { length, nodes } = robot.kinematics;

/** Random numbers that are the same in every run (mulberry32). */
let state = seed;
function random() {
  state = (state + 0x6d2b79f5) | 0;
  let t = Math.imul(state ^ (state >>> 15), 1 | state);
  t ^= t + Math.imul(t ^ (t >>> 7), 61 | t);
  return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
}

let [frames, frameTime, worst, longest, open] = [0, 0, 0, 0, 0];
const statuses = {};
let reports = {};
for (let drag = 0; drag < drags; drag += 1) {
  const node = nodes[1 + Math.floor(random() * (nodes.length - 1))];
  const point = random() < 0.5 ? [0, 0, 0] : [0, 1, 2].map(() => 0.1 * length * (random() - 0.5));
  session.obey({ type: "start_drag", robot: robot.name, node, point, rotation: random() < 0.3 });
  const far = random() < 0.1 ? 4 : length; // m
  const from = robot.placement(node).position.toArray();
  const position = from.map((x) => x + far * (random() - 0.5));
  session.obey({ type: "move_drag", position });
  for (let frame = 0; frame < 3; frame += 1) {
    const begin = performance.now();
    for (let i = 0; i < TICKS; i += 1) {
      session.tick(1 / content.rate);
      worst = Math.max(worst, robot.step.closure);
      if (!(robot.step.closure <= 1e-10)) open += 1;
      statuses[robot.step.status] = (statuses[robot.step.status] ?? 0) + 1;
    }
    if (frames % REPORTS === 0) reports = { [robot.name]: robotReport(robot) };
    stateMessage(session, reports, frames);
    const took = performance.now() - begin;
    [frames, frameTime, longest] = [frames + 1, frameTime + took, Math.max(longest, took)];
  }
  session.obey({ type: "end_drag", pin: false });
  if (random() < 0.01) session.obey({ type: "undo" });
  if (robot.q.some((x) => !Number.isFinite(x))) throw new Error(`drag ${drag}: q is not finite`);
}
process.stdout.write(JSON.stringify({ frames, mean: frameTime / frames, longest, worst, open, statuses }));
