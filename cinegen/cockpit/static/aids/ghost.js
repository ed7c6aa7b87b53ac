// Targets of tasks: a translucent copy of the part at its target, and a line to it where it is not reached.

import { Group, Mesh, Quaternion, Vector3 } from "three";
import { units } from "../base/units.js";
import { ball, paint, rod, span } from "../view/shapes.js";
import { COLOURS, theme } from "../view/theme.js";

const SEEN = 0.012; // characteristic lengths, rad: a smaller error shows no ghost
const LABELLED = 0.02; // characteristic lengths: a larger error has a label

/** @typedef {import("../base/messages").TaskMessage} Task */
/** @typedef {import("three").MeshBasicMaterial} Material */
/**
 * @typedef {{ group: Group, target: Vector3, label: string, paint: Material, veil: Material, ball: Mesh, line: Mesh,
 *   copy: Group }} Mark
 */

export class Ghosts {
  /** @type {Map<number, Mark>} */
  #marks = new Map(); // by the task's id
  #last = ""; // the tasks of the last state

  /**
   * @param {{ view: import("../view/view.js").View, session: import("../base/session.js").Session,
   *   labels: import("../view/labels.js").Labels, aids: import("./aids.js").Aids }} parts
   */
  constructor({ view, session, labels, aids }) {
    this.view = view;
    this.session = session;
    this.labels = labels;
    this.aids = aids;
    session.on("state", ({ tasks = [] }) => {
      const now = JSON.stringify(tasks);
      if (now !== this.#last) view.changed();
      this.#last = now;
    });
    session.on("hello", () => this.#keep(new Set()));
    view.before((drawn) => this.#show(drawn));
  }

  /** @param {boolean} drawn parts may have been drawn since the last call */
  #show(drawn) {
    const tasks = this.aids.shows("ghost") ? this.session.tasks : [];
    this.#keep(new Set(tasks.map((task) => task.id)));
    for (const task of tasks) {
      if (this.session.knows(task.robot, task.node)) this.#place(task, drawn);
    }
  }

  /** @param {Set<number>} ids */
  #keep(ids) {
    for (const [id, mark] of this.#marks) {
      if (ids.has(id)) continue;
      this.view.stage.remove(mark.group);
      this.labels.put(mark.label, "");
      this.#marks.delete(id);
    }
  }

  /**
   * @param {Task} task
   * @param {boolean} drawn
   */
  #place(task, drawn) {
    const length = this.session.robot(task.robot)?.length ?? 1;
    const known = this.#marks.get(task.id);
    const mark = known ?? this.#make(task, length);
    if (drawn || known === undefined) this.#copy(this.view.group(task.robot, task.node), mark);
    const part = this.view.pose(task.robot, task.node);
    const point = new Vector3().fromArray(task.position ?? part.position.toArray());
    const target = mark.target.fromArray(task.target ?? point.toArray());
    const [far = 0, turned = 0] = task.error ?? [];
    const off = far > SEEN * length || turned > SEEN * 5;
    const colour = far > LABELLED * length ? COLOURS.vermilion : theme.accent;
    mark.paint.color.setHex(colour);
    mark.veil.color.setHex(theme.accent);
    mark.ball.position.copy(target);
    span(mark.line, point, target, 0.004 * length);
    mark.line.visible &&= off;
    mark.copy.visible = off;
    if (off) this.#lay(mark.copy, task, part, point, target);
    this.labels.put(mark.label, far > LABELLED * length ? `${units.length(far)} away` : "", target, "far");
  }

  /**
   * Place the copy so that the constrained frame is at its target.
   *
   * @param {Group} copy
   * @param {Task} task
   * @param {{ position: Vector3, quaternion: Quaternion }} part
   * @param {Vector3} point
   * @param {Vector3} target
   */
  #lay(copy, task, part, point, target) {
    const inPart = point.clone().sub(part.position).applyQuaternion(part.quaternion.clone().invert());
    const held = task.rotation === 3 && task.target.length === 7;
    copy.quaternion.copy(held ? new Quaternion().fromArray(task.target, 3) : part.quaternion);
    copy.position.copy(target).sub(inPart.applyQuaternion(copy.quaternion));
  }

  /**
   * @param {Task} task
   * @param {number} length
   * @returns {Mark}
   */
  #make(task, length) {
    const solid = paint(theme.accent, { opacity: 0.9 });
    const mark = {
      group: new Group(),
      target: new Vector3(),
      label: `task ${task.id}`,
      paint: solid,
      veil: paint(theme.accent, { opacity: 0.22, through: false }),
      ball: ball(solid, 0.014 * length),
      line: rod(solid),
      copy: new Group(),
    };
    mark.group.add(mark.ball, mark.line, mark.copy);
    this.view.stage.add(mark.group);
    this.#marks.set(task.id, mark);
    return mark;
  }

  /**
   * Copy the meshes of a part as it is drawn now, without its marks of loops.
   *
   * @param {import("three").Object3D} group
   * @param {Mark} mark
   */
  #copy(group, mark) {
    mark.copy.clear();
    group.updateWorldMatrix(true, true);
    const inverse = group.matrixWorld.clone().invert();
    for (const child of group.children) {
      if (child.name.startsWith("loop ")) continue;
      child.traverse((object) => {
        if (!(object instanceof Mesh)) return;
        const copy = new Mesh(object.geometry, mark.veil);
        copy.matrixAutoUpdate = false;
        copy.matrix.multiplyMatrices(inverse, object.matrixWorld);
        mark.copy.add(copy);
      });
    }
  }
}
