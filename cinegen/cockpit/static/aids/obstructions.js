// What stops a robot among obstacles: a ball at each of the nearest points of the two bodies, a line between, their names.

import { Vector3 } from "three";
import { valueOf } from "../base/names.js";
import { ball, paint, rod, span } from "../view/shapes.js";
import { COLOURS } from "../view/theme.js";

const SIZE = 0.02; // characteristic lengths: radius of a ball

/** @typedef {import("three").Mesh} Mesh */

export class Obstructions {
  /** @type {Map<string, { balls: Mesh[], line: Mesh, where: Vector3 }>} */
  #marks = new Map();

  /** @param {{ view: View, session: Session, labels: Labels }} parts */
  constructor({ view, session, labels }) {
    this.view = view;
    this.session = session;
    this.labels = labels;
    session.on("state", () => this.#show());
    session.on("hello", () => this.#clear());
  }

  #clear() {
    for (const [name, { balls, line }] of this.#marks) {
      this.view.stage.remove(...balls, line);
      this.labels.put(`obstruction ${name}`, "");
    }
    this.#marks.clear();
  }

  #show() {
    const shown = this.session.state?.obstructions ?? {};
    for (const robot of this.session.robots) {
      const obstruction = valueOf(shown, robot.name);
      let mark = this.#marks.get(robot.name);
      if (obstruction === undefined) {
        if (mark?.balls[0].visible) this.labels.put(`obstruction ${robot.name}`, "");
        for (const part of mark === undefined ? [] : [...mark.balls, mark.line]) part.visible = false;
        continue;
      }
      if (mark === undefined) {
        const colour = paint(COLOURS.vermilion, { opacity: 0.9 });
        const balls = [ball(colour, SIZE * robot.length), ball(colour, SIZE * robot.length)];
        mark = { balls, line: rod(colour), where: new Vector3() };
        this.#marks.set(robot.name, mark);
        this.view.stage.add(...balls, mark.line);
      }
      obstruction.points.forEach((point, i) => {
        mark.balls[i].position.set(...point);
        mark.balls[i].visible = true;
      });
      const [first, second] = mark.balls.map((ball) => ball.position);
      mark.line.visible = true;
      span(mark.line, first, second, 0.3 * SIZE * robot.length);
      mark.where.copy(second);
      this.labels.put(`obstruction ${robot.name}`, obstruction.label, mark.where, "far");
      this.view.changed();
    }
  }
}
