// Problems of a text: what is wrong, where, and the likely remedy.

import { limits, texts } from "./definitions.js";
import { fill } from "./texts.js";

/**
 * Location of a word in a text: line and column count from 1, columns and length are in characters (code points).
 *
 * @typedef {{ line: number, column: number, length: number }} Location
 */

/**
 * Locations by what is there.
 *
 * @typedef {ReadonlyMap<string, Location>} Locations
 */

export class Problem {
  /**
   * @param {string} message
   * @param {string} source name of the text
   * @param {Location} [location]
   * @param {string} [text] the line of the location, without its end
   */
  constructor(message, source, location, text = "") {
    this.message = message;
    this.source = source;
    this.location = location;
    this.text = text;
  }

  /** As commands print it, with the line and a caret. */
  toString() {
    const message = shortened(this.message);
    if (!this.location) return this.source ? `${this.source}: ${message}` : message;
    const head = `${this.source}:${this.location.line}:${this.location.column}: ${message}`;
    if (!this.text) return head;
    const { shown, column } = excerpt(this.text, this.location.column);
    const length = Math.max(1, Math.min(this.location.length, shown.length - column + 1));
    return `${head}\n    ${shown.join("")}\n    ${" ".repeat(column - 1)}${"^".repeat(length)}`;
  }
}

/** The text that a document was read from. */
export class SourceText {
  /**
   * @param {string} name
   * @param {string[]} lines
   */
  constructor(name, lines) {
    this.name = name;
    this.lines = lines;
  }

  /**
   * @param {string} message
   * @param {Location} [location]
   */
  problem(message, location) {
    return new Problem(message, this.name, location, location && this.lines[location.line - 1]);
  }
}

/** The only error of the reader. */
export class RaffError extends Error {
  /** @param {Problem[]} problems at least one */
  constructor(problems) {
    const sorted = [...problems].sort((a, b) => compareLocations(a.location, b.location));
    const shown = sorted.slice(0, limits.shownProblems).map(String);
    const count = sorted.length - shown.length;
    super([...shown, ...(count > 0 ? [fill(texts.MORE_PROBLEMS, { count })] : [])].join("\n"));
    this.name = "RaffError";
    /** Every problem, in the order of the text. */
    this.problems = sorted;
  }
}

const NOWHERE = { line: 0, column: 0, length: 1 };

/**
 * Negative if a location comes before another; what has none comes first.
 *
 * @param {Location} [a]
 * @param {Location} [b]
 */
export function compareLocations(a = NOWHERE, b = NOWHERE) {
  return a.line - b.line || a.column - b.column || a.length - b.length;
}

/** @param {string} message */
function shortened(message) {
  if (message.length <= limits.message) return message;
  const letters = Array.from(message);
  if (letters.length <= limits.message) return message;
  const half = limits.message / 2;
  return `${letters.slice(0, half).join("")} ... ${letters.slice(-half).join("")}`;
}

/**
 * The part of a long line around a column, and the column in it; what can't be printed becomes one space.
 *
 * @param {string} text
 * @param {number} column
 */
function excerpt(text, column) {
  const letters = Array.from(text, (letter) => (/[\p{C}\p{Z}]/u.test(letter) ? " " : letter));
  const first = Math.max(0, Math.min(column - 1 - limits.excerpt / 2, letters.length - limits.excerpt));
  return { shown: letters.slice(first, first + limits.excerpt), column: column - first };
}
