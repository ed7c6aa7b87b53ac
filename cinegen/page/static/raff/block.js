// A block of statements, as it is read.

import { texts } from "./definitions.js";
import { fill } from "./texts.js";

/** @typedef {import("./problems.js").Location} Location */
/** @typedef {(message: string, location: Location) => void} Report */
/** @typedef {{ name?: string, repeats?: boolean }} Repetition */

export class Block {
  /**
   * @param {string} kind the word before its brace; empty for the file
   * @param {string} label the block, for errors: "link 2"
   * @param {number} line of its opening brace
   */
  constructor(kind, label, line) {
    this.kind = kind;
    this.label = label;
    this.line = line;
    /** @type {Map<string, any>} values of its statements; lists of those that may be repeated */
    this.values = new Map();
    /** @type {Map<string, Location>} locations of those that may not */
    this.locations = new Map();
  }

  /**
   * Add the value of a statement; of statements that may not be repeated, the first counts.
   *
   * @param {Report} report
   * @param {Repetition} statement
   * @param {string} word
   * @param {unknown} value
   * @param {Location} location
   */
  add(report, statement, word, value, location) {
    const name = statement.name ?? word;
    if (statement.repeats) {
      const list = this.values.get(name);
      if (list) list.push(value);
      else this.values.set(name, [value]);
      return;
    }
    const first = this.locations.get(name);
    if (first) {
      report(fill(texts.GIVEN_TWICE, { word, label: this.label, line: first.line }), location);
      return;
    }
    this.values.set(name, value);
    this.locations.set(name, location);
  }

  /**
   * The value of a statement, or a default.
   *
   * @template T
   * @param {string} name
   * @param {T} otherwise
   * @returns {T}
   */
  get(name, otherwise) {
    return this.values.get(name) ?? otherwise;
  }
}
