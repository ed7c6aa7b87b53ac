// Reactions: an arrow from each joint and loop along the force that it exerts on the part behind it. What statics does not
// determine is not drawn; the panel says so. The server sends them while some page asks.

import { Quaternion, Vector3 } from "three";
import { valueOf } from "../base/names.js";
import { along, arrow, paint, stretch } from "../view/shapes.js";
import { theme } from "../view/theme.js";
import { amount } from "../base/units.js";
import { Changes } from "./changes.js";
import { scaleOf, sizeOf } from "./force_scale.js";

const SHORTEST = 0.01; // of that: shorter arrows are not drawn
const EQUAL = 1e-9; // relative: of forces that differ by rounding only, the first is labelled
const WIDE = 0.011; // characteristic lengths

/** @typedef {import("../base/messages").ReactionReport} ReactionReport */
/** @typedef {{ group: import("three").Group, robot: string, node: string, point: Vector3, where: Vector3 }} Mark */

export class Reactions {
  /** @type {Map<string, Mark>} */
  #marks = new Map();
  #changes = new Changes();
  #paint = paint(theme.ink, { opacity: 0.9 });
  #turn = new Quaternion();

  /** @param {{ view: View, session: Session, labels: Labels, aids: Aids }} parts */
  constructor({ view, session, labels, aids }) {
    this.view = view;
    this.session = session;
    this.labels = labels;
    this.aids = aids;
    this.asked = false;
    theme.follow(() => {
      this.#paint.color.setHex(theme.ink);
      view.changed();
    });
    session.on("hello", () => {
      this.#clear();
      this.asked = false; // of this connection
      this.#ask();
    });
    session.on("report", () => this.#show());
    session.on("state", () => this.#follow());
    aids.on("change", () => {
      this.#ask();
      this.#show();
    });
  }

  #ask() {
    const on = this.aids.shows("reactions");
    if (on === this.asked) return;
    this.asked = on;
    this.session.send({ type: "request_reactions", on });
  }

  #clear() {
    for (const [key, { group }] of this.#marks) {
      this.view.stage.remove(group);
      this.labels.put(key, "");
    }
    this.#marks.clear();
    this.#changes.clear();
  }

  #show() {
    for (const robot of this.session.robots) {
      const reactions = (this.aids.shows("reactions") && valueOf(this.session.report?.robots, robot.name)?.reactions) || [];
      if (!this.#changes.differs(robot.name, reactions)) continue;
      const { newtons, metres } = scaleOf(reactions, robot.length);
      const largest = Math.max(0, ...reactions.map(sizeOf));
      const labelled = reactions.find((reaction) => sizeOf(reaction) >= (1 - EQUAL) * largest);
      const drawn = new Set();
      for (const reaction of reactions) {
        const size = sizeOf(reaction);
        if (reaction.force === null || !(size > SHORTEST * newtons)) continue;
        const key = `reaction ${robot.name} ${reaction.kind} ${reaction.name}`;
        drawn.add(key);
        const mark = this.#marks.get(key) ?? this.#make(key, robot.name, reaction.node);
        mark.point.fromArray(reaction.point);
        along(mark.group, new Vector3().fromArray(reaction.force));
        stretch(mark.group, (metres * size) / newtons, WIDE * robot.length);
        mark.group.visible = true;
        this.labels.put(key, reaction === labelled ? amount(size, "N") : "", mark.where, "force");
      }
      for (const [key, mark] of this.#marks) {
        if (mark.robot !== robot.name || drawn.has(key) || !mark.group.visible) continue;
        mark.group.visible = false;
        this.labels.put(key, "");
      }
      this.view.changed();
    }
    this.#follow();
  }

  /** Arrows start where their joints are by the last state. */
  #follow() {
    for (const { group, robot, node, point, where } of this.#marks.values()) {
      if (!group.visible) continue;
      this.view.pose(robot, node, where, this.#turn);
      where.add(group.position.copy(point).applyQuaternion(this.#turn));
      group.position.copy(where);
    }
  }

  /** @param {string} key @param {string} robot @param {string} node @returns {Mark} */
  #make(key, robot, node) {
    const mark = { group: arrow(this.#paint), robot, node, point: new Vector3(), where: new Vector3() };
    this.view.stage.add(mark.group);
    this.#marks.set(key, mark);
    return mark;
  }
}
