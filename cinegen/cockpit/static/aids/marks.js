// What the server draws and the page looks after: marks of loops turn red where a loop stands open, frames and marks are shown
// or not.

import { Vector3 } from "three";
import { segment, valueOf } from "../base/names.js";
import { units } from "../base/units.js";
import { COLOURS } from "../view/theme.js";

const OPEN = 1e-6; // rad or characteristic lengths

export class Marks {
  /** @type {Set<string>} */
  #open = new Set(); // robots with open loops

  /** @param {{ view: View, session: Session, labels: Labels, aids: Aids }} parts */
  constructor({ view, session, labels, aids }) {
    this.view = view;
    this.session = session;
    this.labels = labels;
    this.aids = aids;
    aids.on("change", () => {
      this.#show();
      view.changed();
    });
    session.on("report", () => this.#gaps());
    view.before((drawn) => {
      if (drawn) this.#show();
    });
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
          material?.color.setHex(open ? COLOURS.vermilion : COLOURS.purple); // as the server has it
        });
        const where = this.view.stage.worldToLocal(mark.getWorldPosition(new Vector3()));
        this.labels.put(`gap ${robot.name} ${loop.name}`, open ? `open by ${units.length(gap * robot.length)}` : "", where, "far");
      }
      this.#show();
      this.view.changed();
    }
  }

  /** @param {KnownRobot} robot @param {import("../base/messages").LoopDescription} loop */
  #mark(robot, loop) {
    if (!robot.byName.has(loop.first)) return undefined;
    return this.view.group(robot.name, loop.first).children.find((child) => child.name === segment(loop.name, "loop "));
  }

  #show() {
    for (const robot of this.session.robots) {
      for (const { name } of robot.nodes) {
        for (const child of this.view.group(robot.name, name).children) {
          if (child.name === "triad") child.visible = this.aids.shows("frames");
          else if (child.name.startsWith("loop ")) child.visible = this.aids.shows("loops") || (this.#open.has(robot.name) && !this.aids.none);
        }
      }
    }
  }
}
