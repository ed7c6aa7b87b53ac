// The worker in which text is read: its answers are all that a text can cause in the page. `linked` in
// cinegen/page/modules.py makes one script of it and the reader.

import { analyse, OpenLoops } from "../raff/closing/analysis.js";
import { graphicsOf } from "../raff/graphics.js";
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
 * @param {import("./reading.js").Files} files that the page holds
 * @returns {Reading}
 */
export function reading(text, name, { known, most }) {
  const { models, document, errors, warnings } = read(text, name);
  const notes = [...errors.map((one) => noteOf(one, "error")), ...warnings.map((one) => noteOf(one, "warning"))];
  if (document === null) return { notes, robots: [] };
  const size = models.reduce((sum, { bodies }) => sum + bodies.length, 0);
  if (size > MOST) return { notes: [...notes, said(`the text has ${size} links and frames: the page shows at most ${MOST}`)], robots: [] };
  const { robots: graphics, problems, more, ...amount } = graphicsOf(document, known);
  notes.push(...problems.map((one) => noteOf(one, "warning")));
  if (more > 0) notes.push(said(`and ${more} more graphics that are not shown`, "warning"));
  if (amount.meshes > most.meshes || amount.triangles > most.triangles) {
    const much = `${amount.meshes} meshes of ${amount.triangles} triangles in all`;
    const message = `the text shows ${much}: the page shows at most ${most.meshes} of ${most.triangles}`;
    return { notes: [...notes, said(`${message}: name fewer files`)], robots: [] };
  }
  try {
    const robots = models.map((model) => {
      const analysis = analyse(model);
      const shown = /** @type {import("./reading.js").Shown} */ (graphics.get(model.robot));
      const bodies = model.bodies.map((body) => ({ ...body, files: null })); // the page needs what is shown only
      return { model: { ...model, bodies }, analysis, tables: tablesOf(model, analysis, RATE), graphics: shown };
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
 * @param {"error" | "warning"} severity
 * @returns {Note}
 */
function said(message, severity = "error") {
  return { severity, message, text: message, line: 0, column: 1, length: 0 };
}

self.addEventListener("message", ({ data: { text, name, files } }) => self.postMessage(reading(text, name, files)));
