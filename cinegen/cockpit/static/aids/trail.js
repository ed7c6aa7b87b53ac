// The trail: the past positions of a task's node, or of the end without tasks. It fades with age.

import { BufferGeometry, Color, Float32BufferAttribute, Line, LineBasicMaterial, Vector3 } from "three";
import { COLOURS, theme } from "../view/theme.js";

const MOST = 600; // points
const APART = 0.004; // characteristic lengths
const JUMP = 0.3; // characteristic lengths: a larger step starts a new trail

/** @typedef {{ points: Vector3[], geometry: BufferGeometry, line: Line, node: string | null, fresh: boolean }} Trail */

export class Trails {
  /** @type {Map<string, Trail>} */
  #trails = new Map();

  /** @param {{ view: View, session: Session, aids: Aids }} parts */
  constructor({ view, session, aids }) {
    this.view = view;
    this.session = session;
    this.aids = aids;
    session.on("state", () => this.#grow());
    session.on("hello", () => this.#clear());
    aids.on("change", () => {
      if (!aids.shows("trail")) this.#clear();
    });
    view.before(() => this.#draw());
  }

  #clear() {
    for (const trail of this.#trails.values()) this.view.stage.remove(trail.line);
    this.#trails.clear();
    this.view.changed();
  }

  #grow() {
    if (!this.aids.shows("trail")) return;
    for (const robot of this.session.robots) {
      const node = this.session.tasks.find((task) => task.robot === robot.name)?.node ?? robot.end;
      if (!robot.byName.has(node)) continue;
      let trail = this.#trails.get(robot.name);
      if (trail === undefined) this.#trails.set(robot.name, (trail = this.#make()));
      if (trail.node !== node) trail.points.length = 0;
      trail.node = node;
      const { position } = this.view.pose(robot.name, node, new Vector3());
      const last = trail.points.at(-1);
      const far = last?.distanceTo(position) ?? Infinity;
      if (far < APART * robot.length) continue;
      if (last !== undefined && far > JUMP * robot.length) trail.points.length = 0;
      trail.points.push(position);
      if (trail.points.length > MOST) trail.points.shift();
      trail.fresh = true;
    }
  }

  #draw() {
    const young = new Color(COLOURS.sky);
    const old = new Color(theme.ground);
    for (const trail of this.#trails.values()) {
      if (!trail.fresh) continue;
      trail.fresh = false;
      const { points, geometry, line } = trail;
      const colours = points.flatMap((_, i) => old.clone().lerp(young, (i + 1) / points.length).toArray(),
      );
      geometry.setAttribute("position", new Float32BufferAttribute(points.flatMap((point) => point.toArray()), 3));
      geometry.setAttribute("color", new Float32BufferAttribute(colours, 3));
      line.visible = points.length > 1;
    }
  }

  /** @returns {Trail} */
  #make() {
    const geometry = new BufferGeometry();
    const line = new Line(geometry, new LineBasicMaterial({ vertexColors: true }));
    line.frustumCulled = false;
    line.visible = false;
    this.view.stage.add(line);
    return { points: [], geometry, line, node: null, fresh: false };
  }
}
