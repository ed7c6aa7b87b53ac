// Read the texts in the lines of standard input (JSON), and write the tables of the robots of each as a line of JSON.
// Numbers that JSON has no form of are texts.

import { createInterface } from "node:readline";

import { analyse } from "../../cinegen/page/static/raff/closing/analysis.js";
import { read } from "../../cinegen/page/static/raff/read.js";
import { tablesOf } from "../../cinegen/page/static/raff/tables/tables.js";

const RATE = 240;
const plain = (key, value) => (typeof value === "number" && !Number.isFinite(value) ? String(value) : value);
for await (const line of createInterface({ input: process.stdin })) {
  const found = read(JSON.parse(line)).models.map((model) => tablesOf(model, analyse(model), RATE));
  process.stdout.write(`${JSON.stringify(found, plain)}\n`);
}
