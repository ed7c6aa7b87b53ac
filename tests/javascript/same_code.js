// Read pairs of texts of modules from standard input (JSON), and write the names of those that are not the same code, but
// for comments.

import { tokenizer } from "acorn";

const tokensOf = (text) => [...tokenizer(text, { ecmaVersion: "latest", sourceType: "module" })].map(({ type, value }) => [type.label, String(value)]);
let input = "";
for await (const part of process.stdin) input += part;
const pairs = Object.entries(JSON.parse(input));
const differ = pairs.filter(([, [expected, generated]]) => JSON.stringify(tokensOf(expected)) !== JSON.stringify(tokensOf(generated)));
process.stdout.write(JSON.stringify(differ.map(([name]) => name)));
