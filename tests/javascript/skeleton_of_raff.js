// Read the texts in the lines of standard input (JSON), and write the skeletons of the robots of each as a line of JSON.

import { createInterface } from "node:readline";

import { skeletonOf } from "../../cinegen/page/static/editor/skeleton.js";
import { read } from "../../cinegen/page/static/raff/read.js";

for await (const line of createInterface({ input: process.stdin })) {
  const found = read(JSON.parse(line)).models.map((model) =>
    Object.fromEntries(skeletonOf(model).map((shapes, i) => [model.bodies[i].name, shapes])));
  process.stdout.write(`${JSON.stringify(found)}\n`);
}
