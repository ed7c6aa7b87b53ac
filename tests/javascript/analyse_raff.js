// Read the texts in the lines of standard input (JSON), and write the analyses of the robots of each as a line of JSON.

import { createInterface } from "node:readline";

import { analyse, OpenLoops } from "../../cinegen/page/static/raff/closing/analysis.js";
import { read } from "../../cinegen/page/static/raff/read.js";

for await (const line of createInterface({ input: process.stdin })) {
  const found = read(JSON.parse(line)).models.map((model) => {
    try {
      return analyse(model);
    } catch (error) {
      if (error instanceof OpenLoops) return error.message;
      throw error;
    }
  });
  process.stdout.write(`${JSON.stringify(found)}\n`);
}
