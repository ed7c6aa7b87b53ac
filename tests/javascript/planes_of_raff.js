// Read the texts in the lines of standard input (JSON), and write the normals of the planes of motion of the robots of each as
// a line of JSON.

import { createInterface } from "node:readline";

import { motionPlane } from "../../cinegen/page/static/editor/motion_plane.js";
import { placements } from "../../cinegen/page/static/editor/placements.js";
import { analyse } from "../../cinegen/page/static/raff/closing/analysis.js";
import { read } from "../../cinegen/page/static/raff/read.js";

for await (const line of createInterface({ input: process.stdin })) {
  const found = read(JSON.parse(line)).models.map((model) => motionPlane(model, placements(model, analyse(model).home)));
  process.stdout.write(`${JSON.stringify(found)}\n`);
}
