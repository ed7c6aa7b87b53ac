// The graphics that a text names, of those that a page holds: what is drawn of each node, and what can't be shown, at the
// words that name it.

import { limits } from "./definitions.js";
import { label, nameOf } from "./document.js";
import { didYouMean } from "./texts.js";

/** @typedef {import("./document.js").Document} Document */
/** @typedef {import("./problems.js").Problem} Problem */

/**
 * What a page knows of a graphic file: its meshes and their triangles, and why it, or a part of it, can't be shown.
 *
 * @typedef {{ meshes: number, triangles: number, problem: string | null }} KnownFile
 */

/**
 * By the name of a node, the keys of the files that it shows: null for a skeleton.
 *
 * @typedef {Map<string, string[] | null>} Shown
 */

/**
 * The graphics of a text: of each robot, by its name; all meshes and triangles, and what can't be shown.
 *
 * @typedef {{ robots: Map<string, Shown>, meshes: number, triangles: number, problems: Problem[], more: number }} Graphics
 */

/**
 * Return the key of a file as a text names it, by its robot's path and its name: as in cinegen/page/graphics.py.
 *
 * @param {string} path
 * @param {string} name
 */
export function keyOf(path, name) {
  const whole = path === "" || name.startsWith("~") || name.startsWith("/") ? name : `${path}/${name}`;
  const parts = whole.split("/").filter((part) => part !== "" && part !== ".");
  return (whole.startsWith("/") ? "/" : "") + parts.join("/");
}

/**
 * Find the graphics of a document among those that a page holds. Of the problems at most a hundred are returned, and the
 * number of `more`.
 *
 * @param {Document} document
 * @param {ReadonlyMap<string, KnownFile>} known files, by their keys
 * @returns {Graphics}
 */
export function graphicsOf(document, known) {
  /** @type {Graphics} */
  const found = { robots: new Map(), meshes: 0, triangles: 0, problems: [], more: 0 };
  const shownKeys = [...known].filter(([, { meshes }]) => meshes > 0).map(([key]) => key);
  for (const robot of document.robots) {
    /** @type {Shown} */
    const shown = new Map();
    for (const node of robot.nodes.values()) {
      const keys = (node.filenames ?? []).map((name) => keyOf(robot.path ?? "", name));
      const drawn = [...new Set(keys)].filter((key) => (known.get(key)?.meshes ?? 0) > 0);
      shown.set(nameOf(node), drawn.length > 0 || node.filenames?.length === 0 ? drawn : null);
      for (const key of drawn) {
        found.meshes += known.get(key)?.meshes ?? 0;
        found.triangles += known.get(key)?.triangles ?? 0;
      }
      for (const [i, key] of keys.entries()) {
        const file = known.get(key);
        if (file !== undefined && file.problem === null) continue;
        if (found.problems.length >= limits.problems) {
          found.more += 1;
          continue;
        }
        const name = (node.filenames ?? [])[i];
        const message = `${label(node)} is drawn ${consequence(name, file, drawn.length > 0)}${reason(key, file, shownKeys)}`;
        found.problems.push(document.source.problem(message, node.locations.get(`file ${i}`)));
      }
    }
    found.robots.set(robot.name, shown);
  }
  return found;
}

/**
 * @param {string} name
 * @param {KnownFile | undefined} file
 * @param {boolean} others are drawn
 */
function consequence(name, file, others) {
  if (file !== undefined && file.meshes > 0) return `with a part of '${name}'`;
  return others ? `without '${name}'` : `as a skeleton, without '${name}'`;
}

/**
 * @param {string} key
 * @param {KnownFile | undefined} file
 * @param {string[]} shown
 */
function reason(key, file, shown) {
  if (file !== undefined) return `: ${file.problem}`;
  const near = didYouMean(key, shown);
  return `: this page holds only the graphics that its text named when it was written${near}`;
}
