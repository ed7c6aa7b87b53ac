// Targets of tasks: a translucent copy of the part at its target, and a thin line to it where it is not reached.

import { BufferGeometry, Group, Line, LineBasicMaterial, Mesh, Quaternion, Vector3 } from "three";
import { isNear } from "../base/units.js";
import { ball, paint } from "../view/shapes.js";
import { theme } from "../view/theme.js";

/** @typedef {import("../base/messages").TaskMessage} Task */
/** @typedef {import("three").MeshBasicMaterial} Material */
/**
 * @typedef {{ group: Group, target: Vector3, paint: Material, veil: Material, ball: Mesh,
 *   line: Line<BufferGeometry, LineBasicMaterial>,
 *   copy: Group }} Mark
 */

export class Targets {
  /** @type {Map<number, Mark>} */
  #marks = new Map(); // by the task's id
  #last = ""; // the tasks of the last state

  /** @param {{ view: View, session: Session, aids: Aids }} parts */
  constructor({ view, session, aids }) {
    this.view = view;
    this.session = session;
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
      this.#marks.delete(id);
    }
  }

  /** @param {Task} task @param {boolean} drawn */
  #place(task, drawn) {
    const length = this.session.robot(task.robot)?.length ?? 1;
    const known = this.#marks.get(task.id);
    const mark = known ?? this.#make(task, length);
    if (drawn || known === undefined) copyOf(this.view.group(task.robot, task.node), mark.copy, mark.veil);
    const part = this.view.pose(task.robot, task.node);
    const point = new Vector3().fromArray(task.position ?? part.position.toArray());
    const target = mark.target.fromArray(task.target ?? point.toArray());
    const off = !isNear(task.error ?? [], length);
    mark.paint.color.setHex(theme.accent);
    mark.line.material.color.setHex(theme.accent);
    mark.veil.color.setHex(theme.accent);
    mark.ball.position.copy(target);
    mark.line.geometry.setFromPoints([point, target]);
    mark.line.visible = off;
    mark.copy.visible = off;
    if (off) this.#lay(mark.copy, task, part, point, target);
  }

  /**
   * Place the copy so that the constrained frame is at its target.
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

  /** @param {Task} task @param {number} length @returns {Mark} */
  #make(task, length) {
    const solid = paint(theme.accent, { opacity: 0.9 });
    const mark = {
      group: new Group(),
      target: new Vector3(),
      paint: solid,
      veil: paint(theme.accent, { opacity: 0.22, through: false }),
      ball: ball(solid, 0.008 * length),
      line: new Line(new BufferGeometry(), new LineBasicMaterial({ depthTest: false, transparent: true })), // one pixel wide
      copy: new Group(),
    };
    mark.line.frustumCulled = false; // it changes
    mark.group.add(mark.ball, mark.line, mark.copy);
    this.view.stage.add(mark.group);
    this.#marks.set(task.id, mark);
    return mark;
  }
}

/**
 * Copy the meshes of a part as it is drawn now, without its marks of loops.
 * @param {import("three").Object3D} part
 * @param {Group} copy
 * @param {Material} veil
 */
export function copyOf(part, copy, veil) {
  copy.clear();
  part.updateWorldMatrix(true, true);
  const inverse = part.matrixWorld.clone().invert();
  for (const child of part.children) {
    if (child.name.startsWith("loop ")) continue;
    child.traverse((object) => {
      if (!(object instanceof Mesh)) return;
      const mesh = new Mesh(object.geometry, veil);
      mesh.matrixAutoUpdate = false;
      mesh.matrix.multiplyMatrices(inverse, object.matrixWorld);
      copy.add(mesh);
    });
  }
}
