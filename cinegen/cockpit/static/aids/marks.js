// What the server draws and the page looks after: parts near a limit get its colour, marks of loops turn red where a
// loop stands open, frames and marks are shown or not.

import { Color, Vector3 } from "three";
import { segment, valueOf } from "../base/names.js";
import { keyOf } from "../base/session.js";
import { units } from "../base/units.js";
import { ball, paint } from "../view/shapes.js";
import { COLOURS } from "../view/theme.js";

const OPEN = 1e-6; // rad or characteristic lengths

/** @typedef {import("../base/session.js").KnownRobot} KnownRobot */
/** @typedef {{ ball: import("three").Mesh, paint: import("three").MeshBasicMaterial, robot: string, node: string }} Halo */

export class Marks {
  /** @type {Map<string, Halo>} */
  #halos = new Map();
  /** @type {Set<string>} */
  #open = new Set(); // robots with open loops

  /**
   * @param {{ view: import("../view/view.js").View, session: import("../base/session.js").Session,
   *   labels: import("../view/labels.js").Labels, aids: import("./aids.js").Aids,
   *   tint: import("../view/tint.js").Tint }} parts
   */
  constructor({ view, session, labels, aids, tint }) {
    this.view = view;
    this.session = session;
    this.labels = labels;
    this.aids = aids;
    this.tint = tint;
    session.on("report", () => this.#limits());
    aids.on("change", () => {
      this.#limits();
      this.#show();
      view.changed();
    });
    session.on("report", () => this.#gaps());
    view.before((drawn) => {
      if (drawn) this.#show();
      this.#follow();
    });
    session.on("hello", () => {
      for (const halo of this.#halos.values()) view.stage.remove(halo.ball);
      this.#halos.clear();
    });
  }

  #limits() {
    for (const robot of this.session.robots) {
      const report = this.aids.shows("limits") ? valueOf(this.session.report?.robots, robot.name) : null;
      const at = new Set(report?.saturated);
      const near = new Set(report?.near_limit);
      for (const { name, joint } of robot.nodes) {
        if (!joint) continue;
        const colour = at.has(joint) ? COLOURS.vermilion : near.has(joint) ? COLOURS.orange : null;
        this.tint.shade(robot.name, name, colour);
        this.#halo(robot, name, colour);
      }
    }
  }

  /**
   * Show a ball on the joint, which is seen through parts: a robot may have the colours of limits itself.
   *
   * @param {KnownRobot} robot
   * @param {string} node
   * @param {number | null} colour
   */
  #halo(robot, node, colour) {
    const key = keyOf(robot.name, node);
    let halo = this.#halos.get(key);
    if (colour === null) {
      if (halo !== undefined) halo.ball.visible = false;
      return;
    }
    if (halo === undefined) {
      const material = paint(colour, { opacity: 0.55 });
      halo = { ball: ball(material, 0.035 * robot.length), paint: material, robot: robot.name, node };
      this.#halos.set(key, halo);
      this.view.stage.add(halo.ball);
    }
    halo.ball.visible = true;
    halo.paint.color.setHex(colour);
  }

  #follow() {
    for (const halo of this.#halos.values()) {
      if (halo.ball.visible) halo.ball.position.copy(this.view.pose(halo.robot, halo.node).position);
    }
  }

  #gaps() {
    for (const robot of this.session.robots) {
      const gap = valueOf(this.session.report?.robots, robot.name)?.closure ?? 0;
      const open = gap > OPEN;
      if (!open && !this.#open.delete(robot.name)) continue;
      if (open) this.#open.add(robot.name);
      for (const loop of robot.loops) {
        const mark = this.#mark(robot, loop);
        if (mark === undefined) continue;
        mark.traverse((object) => {
          const { material } = /** @type {{ material?: import("three").MeshLambertMaterial }} */ (object);
          if (material === undefined) return;
          material.userData.own ??= { colour: material.color.clone() };
          material.color.copy(open ? new Color(COLOURS.vermilion) : material.userData.own.colour);
        });
        const where = this.view.stage.worldToLocal(mark.getWorldPosition(new Vector3()));
        this.labels.put(
          `gap ${robot.name} ${loop.name}`,
          open ? `open by ${units.length(gap * robot.length)}` : "",
          where,
          "far",
        );
      }
      this.view.changed();
    }
  }

  /**
   * @param {KnownRobot} robot
   * @param {import("../base/messages").LoopDescription} loop
   */
  #mark(robot, loop) {
    if (!robot.byName.has(loop.first)) return undefined;
    return this.view.group(robot.name, loop.first).children.find((child) => child.name === segment(loop.name, "loop "));
  }

  #show() {
    for (const robot of this.session.robots) {
      for (const { name } of robot.nodes) {
        for (const child of this.view.group(robot.name, name).children) {
          if (child.name === "triad") child.visible = this.aids.shows("frames");
          else if (child.name.startsWith("loop ")) child.visible = this.aids.shows("loops");
        }
      }
    }
  }
}
