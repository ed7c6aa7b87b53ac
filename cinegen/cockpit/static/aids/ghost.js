// Where what is pulled should be: a translucent copy of the part at its target, and the way from the one to the other
// where it can't be reached.

import { Group, Mesh, Quaternion, Vector3 } from "three";
import { units } from "../base/units.js";
import { ball, paint, rod, span } from "../view/shapes.js";
import { COLOURS, theme } from "../view/theme.js";

const SEEN = 0.012; // characteristic lengths, rad: a smaller error shows no ghost
const SAID = 0.02; // characteristic lengths: a larger one is told in words

export class Ghosts {
  #marks = new Map(); // by the task's id
  #told = ""; // the tasks of the last state

  constructor({ view, session, labels, aids }) {
    Object.assign(this, { view, session, labels, aids });
    session.on("state", ({ tasks = [] }) => {
      const told = JSON.stringify(tasks);
      if (told !== this.#told) view.changed();
      this.#told = told;
    });
    session.on("hello", () => this.#keep(new Set()));
    view.before(() => this.#show());
  }

  #show() {
    const tasks = this.aids.shows("ghost") ? this.session.tasks : [];
    this.#keep(new Set(tasks.map((task) => task.id)));
    for (const task of tasks) {
      if (this.session.knows(task.robot, task.node)) this.#place(task);
    }
  }

  #keep(ids) {
    for (const [id, mark] of this.#marks) {
      if (ids.has(id)) continue;
      this.view.stage.remove(mark.group);
      this.labels.put(mark.label, "");
      this.#marks.delete(id);
    }
  }

  #place(task) {
    const { length } = this.session.robot(task.robot);
    const mark = this.#marks.get(task.id) ?? this.#make(task, length);
    const part = this.view.pose(task.robot, task.node);
    const point = new Vector3().fromArray(task.position ?? part.position.toArray());
    const target = mark.target.fromArray(task.target ?? point.toArray());
    const [far = 0, turned = 0] = task.error ?? [];
    const off = far > SEEN * length || turned > SEEN * 5;
    const colour = far > SAID * length ? COLOURS.vermillion : theme.accent;
    mark.paint.color.setHex(colour);
    mark.veil.color.setHex(theme.accent);
    mark.ball.position.copy(target);
    span(mark.way, point, target, 0.004 * length);
    mark.way.visible &&= off;
    mark.copy.visible = off;
    if (off) this.#lay(mark.copy, task, part, point, target);
    this.labels.put(mark.label, far > SAID * length ? `${units.length(far)} away` : "", target, "far");
  }

  /** The copy stands so that the pulled point is at its target. */
  #lay(copy, task, part, point, target) {
    const inPart = point.clone().sub(part.position).applyQuaternion(part.quaternion.clone().invert());
    const held = task.rotation === 3 && task.target.length === 7;
    copy.quaternion.copy(held ? new Quaternion().fromArray(task.target, 3) : part.quaternion);
    copy.position.copy(target).sub(inPart.applyQuaternion(copy.quaternion));
  }

  #make(task, length) {
    const mark = {
      group: new Group(),
      target: new Vector3(),
      label: `task ${task.id}`,
      paint: paint(theme.accent, { opacity: 0.9 }),
      veil: paint(theme.accent, { opacity: 0.22, through: false }),
    };
    mark.ball = ball(mark.paint, 0.014 * length);
    mark.way = rod(mark.paint);
    mark.copy = new Group();
    this.#copy(this.view.group(task.robot, task.node), mark);
    mark.group.add(mark.ball, mark.way, mark.copy);
    this.view.stage.add(mark.group);
    this.#marks.set(task.id, mark);
    return mark;
  }

  /** The part's meshes, seen from the part; its marks of loops are no part of it. */
  #copy(group, mark) {
    group.updateWorldMatrix(true, true);
    const inverse = group.matrixWorld.clone().invert();
    for (const child of group.children) {
      if (child.name.startsWith("loop ")) continue;
      child.traverse((object) => {
        if (!object.isMesh) return;
        const copy = new Mesh(object.geometry, mark.veil);
        copy.matrixAutoUpdate = false;
        copy.matrix.multiplyMatrices(inverse, object.matrixWorld);
        mark.copy.add(copy);
      });
    }
  }
}
