import assert from "node:assert/strict";
import { test } from "node:test";

import { tokens, tokensOfLine } from "../../cinegen/page/static/raff/tokens.js";

/** @param {string} text */
const shown = (text) => tokens(text).map(({ from, to, kind }) => `${kind} ${text.slice(from, to)}`);

test("words of the grammar are keywords, and names are not, even if they look like one", () => {
  assert.deepEqual(shown('RAFF link // of all\nrobot robot { name "a//b" limts -5e3 5mm }\n"open'), [
    "keyword RAFF", "name link", "comment // of all", "keyword robot", "name robot", "bracket {", "keyword name",
    'string "a//b"', "name limts", "number -5e3", "name 5mm", "bracket }", 'invalid "', "name open",
  ]);
});

test("a name may be on the line below its word", () => {
  assert.deepEqual(shown("robot // the\n\n link"), ["keyword robot", "comment // the", "name link"]);
  assert.deepEqual(tokensOfLine(" link", true), [{ from: 1, to: 5, kind: "name" }]);
});

test("what is no token is white space, in any text", () => {
  const scraps = ["link", " ", "\t", "\n", "\r\n", "{", "}", "(", ")", '"', "//", "/", "5", "-.5e3x", "\u00a0", "\u2028", "🦾", "\ud800", "\0", "é"];
  let seed = 1;
  const random = (/** @type {number} */ below) => (seed = (seed * 48271) % 2147483647) % below;
  for (let i = 0; i < 300; i++) {
    const text = Array.from({ length: random(60) }, () => scraps[random(scraps.length)]).join("");
    let end = 0;
    for (const { from, to } of tokens(text)) {
      assert.ok(from >= end && to > from, JSON.stringify(text));
      assert.match(text.slice(end, from), /^\s*$/u);
      end = to;
    }
    assert.match(text.slice(end), /^\s*$/u);
  }
});
