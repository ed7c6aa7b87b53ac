// From RAFF text to models of its robots, with every error and warning of `raff2urdf --check` but those of open loops.

import { check } from "./check.js";
import { model } from "./model.js";
import { RaffError } from "./problems.js";
import { parse } from "./reader.js";

/** @typedef {import("./model.js").Model} Model */
/** @typedef {import("./problems.js").Problem} Problem */

/**
 * Models of a text's robots and its document, or none and the errors; warnings are of valid text.
 *
 * @typedef {{ models: Model[], document: import("./document.js").Document | null, errors: Problem[], warnings: Problem[] }} Reading
 */

/**
 * Read RAFF text. This never throws.
 *
 * @param {string} text
 * @param {string} [name] of the text, in errors
 * @returns {Reading}
 */
export function read(text, name) {
  /** @type {Problem[]} */
  let warnings = [];
  try {
    const document = parse(text, name);
    warnings = check(document);
    return { models: document.robots.map((robot) => model(document, robot)), document, errors: [], warnings };
  } catch (error) {
    if (error instanceof RaffError) return { models: [], document: null, errors: error.problems, warnings };
    throw error;
  }
}
