// The worker in which text is read: its answers are all that a text can cause in the page. `linked` in
// cinegen/page/modules.py makes one script of it and the reader.

import { analyse, OpenLoops } from "../raff/closing/analysis.js";
import { read } from "../raff/read.js";
import { tablesOf } from "../raff/tables/tables.js";

const RATE = 240; // ticks per second
const MOST = 300; // bodies of all robots: more make the page slow

/** @typedef {import("../raff/problems.js").Problem} Problem */
/** @typedef {import("./reading.js").Note} Note */
/** @typedef {import("./reading.js").Reading} Reading */

/**
 * Read a text. This never throws.
 *
 * @param {string} text
 * @param {string} name of it
 * @returns {Reading}
 */
export function reading(text, name) {
  const { models, errors, warnings } = read(text, name);
  const notes = [...errors.map((one) => noteOf(one, "error")), ...warnings.map((one) => noteOf(one, "warning"))];
  if (errors.length > 0) return { notes, robots: [] };
  const size = models.reduce((sum, { bodies }) => sum + bodies.length, 0);
  if (size > MOST) return { notes: [...notes, said(`the text has ${size} links and frames: the page shows at most ${MOST}`)], robots: [] };
  try {
    const robots = models.map((model) => {
      const analysis = analyse(model);
      return { model, analysis, tables: tablesOf(model, analysis, RATE) };
    });
    return { notes, robots };
  } catch (error) {
    if (!(error instanceof OpenLoops)) throw error;
    return { notes: [...notes, said(`${name}: ${error.message}`)], robots: [] };
  }
}

/**
 * @param {Problem} problem
 * @param {"error" | "warning"} severity
 * @returns {Note}
 */
function noteOf(problem, severity) {
  const { line, column, length } = problem.location ?? { line: 0, column: 1, length: 0 };
  return { severity, message: problem.message, text: String(problem), line, column, length };
}

/**
 * @param {string} message
 * @returns {Note}
 */
function said(message) {
  return { severity: "error", message, text: message, line: 0, column: 1, length: 0 };
}

self.addEventListener("message", ({ data: { text, name } }) => self.postMessage(reading(text, name)));
