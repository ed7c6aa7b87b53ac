// The manipulability ellipsoid: long where the tool moves easily, flat where it hardly does.

import { Group, Matrix4, Mesh, SphereGeometry, Vector3 } from "three";
import { valueOf } from "../base/names.js";
import { Changes } from "./changes.js";
import { paint, rod, span } from "../view/shapes.js";
import { COLOURS } from "../view/theme.js";

const FLAT = 1e-3; // of the longest half axis: none is thinner
const ORIGIN = new Vector3();

/** @typedef {{ group: Group, body: Mesh, rods: Mesh[] }} Drawn */

export class Ellipsoids {
  /** @type {Map<string, Drawn>} */
  #shown = new Map();
  #changes = new Changes();

  /** @param {{ view: View, session: Session, aids: Aids }} parts */
  constructor({ view, session, aids }) {
    this.view = view;
    this.session = session;
    this.aids = aids;
    session.on("report", () => this.#show());
    session.on("hello", () => {
      for (const drawn of this.#shown.values()) view.stage.remove(drawn.group);
      this.#shown.clear();
      this.#changes.clear();
    });
    aids.on("change", () => this.#show());
  }

  #show() {
    for (const robot of this.session.robots) {
      const ellipsoid = this.aids.shows("ellipsoid") ? valueOf(this.session.report?.robots, robot.name)?.ellipsoid : null;
      const drawn = this.#shown.get(robot.name);
      if (!this.#changes.differs(robot.name, ellipsoid)) continue;
      if (ellipsoid?.center && ellipsoid.axes?.length > 0) this.#place(drawn ?? this.#make(robot.name), ellipsoid, robot);
      else if (drawn?.group.visible) {
        drawn.group.visible = false;
        this.view.changed();
      }
    }
  }

  /** @param {Drawn} drawn @param {import("../base/messages").Ellipsoid} ellipsoid @param {KnownRobot} robot */
  #place(drawn, ellipsoid, robot) {
    const axes = [0, 1, 2].map((i) => new Vector3().fromArray(ellipsoid.axes[i] ?? [0, 0, 0]));
    const longest = Math.max(...axes.map((axis) => axis.length()));
    if (!(longest > 0)) return;
    axes.forEach((axis, i) => {
      // what is flat stays a body: across the other two
      if (axis.length() >= FLAT * longest) return;
      const [first, second] = axes.filter((_, k) => k !== i);
      axis.copy(first).cross(second);
      if (axis.lengthSq() === 0) axis.set(first.y - second.z, second.x + first.z, first.x + 1e-9);
      axis.setLength(FLAT * longest);
    });
    drawn.group.visible = true;
    drawn.group.position.fromArray(ellipsoid.center);
    drawn.body.matrix.copy(new Matrix4().makeBasis(axes[0], axes[1], axes[2]));
    drawn.body.matrixWorldNeedsUpdate = true;
    axes.forEach((axis, i) => span(drawn.rods[i], axis.clone().negate(), axis, 0.003 * robot.length));
    this.view.changed();
  }

  /** @param {string} name @returns {Drawn} */
  #make(name) {
    const group = new Group();
    const body = new Mesh(new SphereGeometry(1, 32, 20), paint(COLOURS.green, { opacity: 0.22, through: false }));
    body.matrixAutoUpdate = false;
    const ink = paint(COLOURS.green, { opacity: 0.8 });
    const rods = [0, 1, 2].map(() => rod(ink));
    rods.forEach((made) => span(made, ORIGIN, ORIGIN, 0));
    group.add(body, ...rods);
    this.view.stage.add(group);
    const drawn = { group, body, rods };
    this.#shown.set(name, drawn);
    return drawn;
  }
}
