// Read texts, each with the files that a page holds, in the lines of standard input (JSON), and write what is shown of
// each text, and what is not, as a line of JSON.

import { createInterface } from "node:readline";

import { graphicsOf } from "../../cinegen/page/static/raff/graphics.js";
import { read } from "../../cinegen/page/static/raff/read.js";

for await (const line of createInterface({ input: process.stdin })) {
  const { text, known } = JSON.parse(line);
  const { document } = read(text, "t.raff");
  const { robots, problems, ...numbers } = graphicsOf(document, new Map(Object.entries(known)));
  const shown = Object.fromEntries([...robots].map(([name, nodes]) => [name, Object.fromEntries(nodes)]));
  process.stdout.write(`${JSON.stringify({ shown, problems: problems.map(String), ...numbers })}\n`);
}
