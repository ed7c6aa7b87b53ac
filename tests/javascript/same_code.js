// Read pairs of texts of modules from standard input (JSON), and write the names of those that are not the same code, but
// for comments.

import { tokenizer } from "acorn";

const tokensOf = (text) => [...tokenizer(text, { ecmaVersion: "latest", sourceType: "module" })].map(({ type, value }) => [type.label, String(value)]);
let given = "";
for await (const part of process.stdin) given += part;
const pairs = Object.entries(JSON.parse(given));
const differ = pairs.filter(([, [one, other]]) => JSON.stringify(tokensOf(one)) !== JSON.stringify(tokensOf(other)));
process.stdout.write(JSON.stringify(differ.map(([name]) => name)));
