// Robots as lines between their nodes, where pictures of their parts take too long; parts near a line can be touched.

import {
  BufferGeometry, Float32BufferAttribute, LineBasicMaterial, LineSegments, Points, PointsMaterial, Vector3,
} from "three";
import { theme } from "./theme.js";

const REACH = 12; // pixels from a line
const ANGLE = 0.02; // rad between a ray and a line

/**
 * @typedef {{ geometry: BufferGeometry, lines: LineSegments<BufferGeometry, LineBasicMaterial>,
 *   dots: Points<BufferGeometry, PointsMaterial> }} Drawn
 */

export class Skeleton {
  /** @type {Map<string, Drawn>} */
  #robots = new Map();
  #on = false;
  #offered = false;

  /** @param {{ view: View, session: Session, aids: Aids, pick: import("../pointer/pick.js").Pick }} parts */
  constructor({ view, session, aids, pick }) {
    this.view = view;
    this.session = session;
    this.aids = aids;
    pick.extra = (event) => this.#touched(event);
    pick.extraAlong = (ray) => this.#along(ray);
    session.on("hello", () => {
      this.#clear();
      this.#switch();
    });
    aids.on("change", () => this.#switch());
    view.resolution.on("slow", () => {
      if (this.#offered || this.#on) return;
      this.#offered = true;
      const action = { label: "Draw skeletons", run: () => aids.draw("skeleton") };
      session.emit("notice", { text: "Drawing is slow here.", action });
    });
    view.before((drawn) => {
      if (drawn && this.#on) this.#hide();
      if (this.#on) this.#draw();
    });
  }

  #switch() {
    const on = this.aids.bodies === "skeleton";
    if (this.#on === on) return;
    this.#on = on;
    this.#hide();
    if (!this.#on) this.#clear();
    this.view.changed();
  }

  #hide() {
    for (const robot of this.session.robots) {
      for (const { name } of robot.nodes) {
        for (const child of this.view.group(robot.name, name).children) {
          if (child.name !== "triad" && !child.name.startsWith("loop ")) child.visible = !this.#on;
        }
      }
    }
  }

  #clear() {
    for (const { lines, dots } of this.#robots.values()) this.view.stage.remove(lines, dots);
    this.#robots.clear();
  }

  /**
   * Return the bones of a robot in the world, from each node's parent and across each loop.
   * @param {KnownRobot} robot
   * @returns {[string, Vector3, Vector3][]} node, from, to
   */
  #bones(robot) {
    const where = new Map(
      robot.nodes.map(({ name }) => [name, this.view.pose(robot.name, name, new Vector3()).position]),
    );
    const pairs = [
      ...robot.nodes.map(({ name, parent }) => [name, parent ?? "", name]),
      ...robot.loops.map(({ first, second }) => [first, first, second]),
    ];
    return pairs.flatMap(([node, first, second]) => {
      const [from, to] = [where.get(first), where.get(second)];
      return from === undefined || to === undefined ? [] : [/** @type {[string, Vector3, Vector3]} */ ([node, from, to])];
    });
  }

  #draw() {
    for (const robot of this.session.robots) {
      let skeleton = this.#robots.get(robot.name);
      if (skeleton === undefined) this.#robots.set(robot.name, (skeleton = this.#make()));
      const ends = this.#bones(robot).flatMap(([, from, to]) => [...from.toArray(), ...to.toArray()]);
      skeleton.geometry.setAttribute("position", new Float32BufferAttribute(ends, 3));
      skeleton.lines.material.color.setHex(theme.ink);
      skeleton.dots.material.color.setHex(theme.accent);
    }
  }

  #make() {
    const geometry = new BufferGeometry();
    const lines = new LineSegments(geometry, new LineBasicMaterial());
    const dots = new Points(geometry, new PointsMaterial({ size: 7, sizeAttenuation: false }));
    lines.frustumCulled = dots.frustumCulled = false;
    this.view.stage.add(lines, dots);
    return { geometry, lines, dots };
  }

  /** @param {At} event @returns {Touched | null} */
  #touched(event) {
    if (!this.#on) return null;
    const box = this.view.canvas.getBoundingClientRect();
    const x = event.clientX - box.left;
    const y = event.clientY - box.top;
    let best = { far: REACH, robot: "", node: "", at: new Vector3() };
    for (const robot of this.session.robots) {
      for (const [node, from, to] of this.#bones(robot)) {
        const [a, b] = [this.view.pixels(from, new Vector3()), this.view.pixels(to, new Vector3())];
        if (a === null || b === null) continue;
        const long = (b.x - a.x) ** 2 + (b.y - a.y) ** 2;
        const share =
          long > 0 ? Math.min(1, Math.max(0, ((x - a.x) * (b.x - a.x) + (y - a.y) * (b.y - a.y)) / long)) : 0;
        const far = Math.hypot(a.x + share * (b.x - a.x) - x, a.y + share * (b.y - a.y) - y);
        if (far < best.far) best = { far, robot: robot.name, node, at: from.clone().lerp(to, share) };
      }
    }
    if (best.node === "") return null;
    const { robot, node, at } = best;
    return { robot, node, group: this.view.group(robot, node), point: this.view.stage.localToWorld(at) };
  }

  /** @param {import("three").Ray} ray in three's own axes @returns {Touched | null} */
  #along(ray) {
    if (!this.#on) return null;
    const [seen, at] = [new Vector3(), new Vector3()];
    /** @type {Touched | null} */
    let best = null;
    let least = ANGLE;
    for (const robot of this.session.robots) {
      for (const [node, from, to] of this.#bones(robot)) {
        for (const end of [from, to]) this.view.stage.localToWorld(end);
        const far = Math.sqrt(ray.distanceSqToSegment(from, to, seen, at));
        const away = seen.distanceTo(ray.origin);
        if (!(far < least * away)) continue;
        least = far / away;
        best = { robot: robot.name, node, group: this.view.group(robot.name, node), point: at.clone(), away };
      }
    }
    return best;
  }
}
