// The tokens of RAFF text, by the regular expressions that Python's reader has, and their kinds for highlighting.

import { statements, tokens as PATTERNS } from "./definitions.js";
import { characters } from "./texts.js";

/** @typedef {import("./problems.js").Location} Location */

/**
 * A token: its kind is NUMBER, STRING, WORD, ILLEGAL, MISSING or END; of a brace or parenthesis, itself.
 *
 * @typedef {{ kind: string, text: string, line: number, column: number }} Token
 */

const KINDS = Object.keys(PATTERNS).filter((kind) => kind);
const PATTERN = new RegExp(
  Object.entries(PATTERNS).map(([kind, pattern]) => (kind ? `(${pattern})` : pattern)).join("|"),
  "gsu", // dots match what separates lines in JavaScript alone
);

/**
 * Yield the tokens of a text; the last one is of the kind END, and is repeated.
 *
 * @param {readonly string[]} lines
 * @returns {Generator<Token, never>}
 */
export function* tokensOf(lines) {
  let end = { kind: "END", text: "", line: Math.max(1, lines.length), column: 1 };
  for (const [i, line] of lines.entries()) {
    const isPlain = !/[\ud800-\udbff]/.test(line); // each unit of UTF-16 is a character
    let column = 1;
    PATTERN.lastIndex = 0;
    for (let found = PATTERN.exec(line); found; found = PATTERN.exec(line)) {
      const next = PATTERN.lastIndex;
      const kind = kindOf(found);
      const text = found[0];
      const length = isPlain ? text.length : characters(text);
      if (kind) {
        end = { kind: "END", text: "", line: i + 1, column: column + length };
        yield { kind: kind === "MARK" ? text : kind, text, line: i + 1, column };
      }
      column += length; // tokens and what parts them are all of a line
      PATTERN.lastIndex = next; // others may use it between two tokens
    }
  }
  for (;;) yield end;
}

/**
 * @param {Token} token
 * @returns {Location}
 */
export function locationOf(token) {
  return { line: token.line, column: token.column, length: characters(token.text) };
}

/**
 * The text without its quotation marks.
 *
 * @param {Token} token
 */
export function stringOf(token) {
  return token.kind === "STRING" ? token.text.slice(1, -1) : token.text;
}

/** @param {RegExpMatchArray} found */
function kindOf(found) {
  for (let i = 1; i < found.length; i++) if (found[i] !== undefined) return KINDS[i - 1];
  return "";
}

// --- highlighting ---------------------------------------------------------------------------------------------------

/** @typedef {"comment" | "number" | "string" | "keyword" | "name" | "bracket" | "invalid"} Highlight */

/**
 * A part of a text and its kind; `from` and `to` are indices in the text, as CodeMirror counts.
 *
 * @typedef {{ from: number, to: number, kind: Highlight }} Highlighted
 */

const WORDS = new Set(["RAFF", ...Object.values(statements).flatMap((words) => Object.keys(words))]);
const NAMED = new Set(["RAFF"]); // words that a name follows
for (const words of Object.values(statements)) {
  for (const [word, { follows }] of Object.entries(words)) if (/^(NAME|WORD)\b/.test(follows)) NAMED.add(word);
}

/**
 * Return the parts of a text that are not white space, in order.
 *
 * @param {string} text
 * @returns {Highlighted[]}
 */
export function tokens(text) {
  /** @type {Highlighted[]} */
  const found = [];
  let from = 0;
  let named = false;
  for (const line of text.split("\n")) {
    for (const one of tokensOfLine(line, named)) {
      if (one.kind !== "comment") named = one.kind === "keyword" && NAMED.has(line.slice(one.from, one.to));
      found.push({ ...one, from: from + one.from, to: from + one.to });
    }
    from += line.length + 1;
  }
  return found;
}

/**
 * Return the parts of a line, none of which goes on in the next one.
 *
 * @param {string} line
 * @param {boolean} [named] whether the last word of the lines before is followed by a name, which is no keyword
 * @returns {Highlighted[]}
 */
export function tokensOfLine(line, named = false) {
  /** @type {Highlighted[]} */
  const found = [];
  for (const match of line.matchAll(PATTERN)) {
    const kind = highlightOf(kindOf(match), match[0], named);
    if (!kind) continue;
    found.push({ from: match.index, to: match.index + match[0].length, kind });
    if (kind !== "comment") named = kind === "keyword" && NAMED.has(match[0]);
  }
  return found;
}

/**
 * @param {string} kind
 * @param {string} text
 * @param {boolean} named
 * @returns {Highlight | undefined}
 */
function highlightOf(kind, text, named) {
  if (kind === "WORD") return WORDS.has(text) && !named ? "keyword" : "name";
  if (kind === "NUMBER") return "number";
  if (kind === "STRING") return "string";
  if (kind === "MARK") return "bracket";
  if (kind === "ILLEGAL") return "invalid";
  return text.startsWith("//") ? "comment" : undefined;
}
