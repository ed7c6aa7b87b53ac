// The graphic files that the page holds: they were named by its text when it was written.

import { Mesh } from "three";
import { bytesOf } from "../session/link.js";

const PLACE = ["graphics"]; // where the viewer draws the commands of a file, as cinegen/page/graphics.py has it
const MOST = { meshes: 2000, triangles: 1_000_000 }; // that edited text shows

/** @typedef {import("../raff/graphics.js").KnownFile} KnownFile */
/**
 * A file: `commands` draw its surfaces, `uses` is the number of nodes that named it.
 *
 * @typedef {{ key: string, commands: string[], problem: string | null, uses: number }} EmbeddedFile
 */
/** @typedef {{ meshes: number, triangles: number }} Amount */

export class GraphicFiles {
  /** @type {Map<string, Mesh[]>} */
  #meshes = new Map();
  /** @type {Map<string, KnownFile>} */
  known = new Map();
  /** What edited text may show: more takes the page too long, unless the text that it was written for has it. */
  most = { ...MOST };

  /**
   * @param {import("../../../cockpit/static/view/view.js").View["viewer"]} viewer
   * @param {EmbeddedFile[]} files
   */
  constructor(viewer, files) {
    const own = { meshes: 0, triangles: 0 };
    for (const { key, commands, problem, uses } of files) {
      const meshes = read(viewer, commands);
      const triangles = meshes.reduce((sum, { geometry }) => sum + (geometry.index ?? geometry.attributes.position).count / 3, 0);
      this.#meshes.set(key, meshes);
      this.known.set(key, { meshes: meshes.length, triangles, problem });
      own.meshes += uses * meshes.length;
      own.triangles += uses * triangles;
    }
    for (const of of /** @type {const} */ (["meshes", "triangles"])) this.most[of] = Math.max(this.most[of], own[of]);
  }

  /**
   * Return the meshes of a file, in its unit of length: their geometry is shared, their colours are not.
   *
   * @param {string} key
   */
  meshesOf(key) {
    return (this.#meshes.get(key) ?? []).map((mesh) => {
      const copy = mesh.clone();
      copy.material = [mesh.material].flat()[0].clone();
      return copy;
    });
  }
}

/**
 * Let the viewer read the surfaces of a file, and take them out of its scene.
 *
 * @param {import("../../../cockpit/static/view/view.js").View["viewer"]} viewer
 * @param {string[]} commands
 */
function read(viewer, commands) {
  for (const command of commands) viewer.handle_command_message({ data: bytesOf(command) });
  /** @type {Mesh[]} */
  const found = [];
  viewer.scene_tree.find(PLACE).object.traverse((object) => {
    if (object instanceof Mesh) found.push(object);
  });
  viewer.delete_path(PLACE);
  for (const mesh of found) mesh.removeFromParent();
  return found;
}
