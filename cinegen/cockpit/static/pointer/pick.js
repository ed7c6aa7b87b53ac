// What is under the pointer: the nearest part of a robot.

import { Mesh, Raycaster, Vector2 } from "three";
import { nameOf } from "../base/names.js";
import { TOGETHER } from "../view/instances.js";

const NEAR = [0, 6, 12]; // pixels: the pointer trembles, and a part moves on while its picture is drawn
const AROUND = 8;

/**
 * @typedef {{ clientX: number, clientY: number }} At a pointer
 * @typedef {{ robot: string, node: string, group: import("three").Object3D }} Owner
 * @typedef {Owner & { point: import("three").Vector3, away?: number, normal?: import("three").Vector3 }} Touched `away` and
 *   `normal` are known of meshes only
 */

export class Pick {
  #ray = new Raycaster();

  /** @param {View} view @param {Session} session */
  constructor(view, session) {
    this.view = view;
    this.session = session;
    this.#ray.layers.enable(TOGETHER);
    /** @type {((ray: import("three").Ray, away: number) => boolean) | null} */
    this.veil = null; // (ray, away) -> whether something that is no part is seen there, nearer than that
    /** @type {((event: At) => Touched | null) | null} */
    this.extra = null; // (event) -> part or null: what else can be touched where no mesh is
    /** @type {((ray: import("three").Ray) => Touched | null) | null} */
    this.extraAlong = null; // the same along a ray of three's own axes
  }

  /** The ray through a pointer, in three's own axes. @param {At} event */
  aim(event) {
    const box = this.view.canvas.getBoundingClientRect();
    const at = new Vector2(
      (2 * (event.clientX - box.left)) / box.width - 1,
      1 - (2 * (event.clientY - box.top)) / box.height,
    );
    this.#ray.setFromCamera(at, this.view.camera);
    return this.#ray.ray;
  }

  /** The same of a pointer that need not be exact: what lies nearest to it, a few pixels around; unless something that
   * is no part is seen right there.
   *
   * @param {At} event
   * @returns {Touched | null}
   */
  near(event) {
    if (this.#veiled(event)) return null;
    for (const away of NEAR) {
      for (let turn = 0; turn < (away ? AROUND : 1); turn += 1) {
        const angle = (2 * Math.PI * turn) / AROUND;
        const clientX = event.clientX + away * Math.cos(angle);
        const part = this.touched({ clientX, clientY: event.clientY + away * Math.sin(angle) });
        if (part !== null) return part;
      }
    }
    return null;
  }

  /**
   * The robot, the node, its group and the point (three's own axes) that a pointer touches; null if none.
   * @param {At} event
   * @returns {Touched | null}
   */
  touched(event) {
    this.aim(event);
    return this.#met() ?? this.extra?.(event) ?? null;
  }

  /** The same along a ray in three's own axes. @param {import("three").Ray} ray @returns {Touched | null} */
  along(ray) {
    this.#ray.ray.copy(ray);
    return this.#met() ?? this.extraAlong?.(ray) ?? null;
  }

  /** @returns {Touched | null} */
  #met() {
    const { root } = this.view;
    for (const hit of this.#ray.intersectObject(root, true)) {
      if (!(hit.object instanceof Mesh)) continue;
      const part = this.#owner(hit.object, root);
      if (part === null) continue;
      const normal = hit.face?.normal.clone().transformDirection(hit.object.matrixWorld);
      return { ...part, point: hit.point, away: hit.distance, normal };
    }
    return null;
  }

  /** The part that one sees under a pointer; null if none. @param {At} event */
  seen(event) {
    return this.#veiled(event) ? null : this.touched(event);
  }

  /** Whether something that is no part is what one sees there. @param {At} event */
  #veiled(event) {
    if (this.veil === null) return false;
    const away = this.touched(event)?.away ?? Infinity;
    return this.veil(this.aim(event), away);
  }

  /** @param {import("three").Object3D} object @param {import("three").Object3D} root @returns {Owner | null} */
  #owner(object, root) {
    const path = [];
    for (let at = /** @type {import("three").Object3D | null} */ (object); at !== null && at !== root; at = at.parent) path.unshift(at);
    if (path.length < 2) return null;
    const group = path[1];
    const [robot, node] = path.map(({ name }) => nameOf(name));
    if (this.view.background.has(robot) || !group.visible) return null;
    return this.session.knows(robot, node) ? { robot, node, group } : null;
  }
}
