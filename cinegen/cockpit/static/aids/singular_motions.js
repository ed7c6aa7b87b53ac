// Motions that are lost near a type 1 singularity, or uncontrolled near a type 2 singularity: a double arrow for a
// translation, an arc for a rotation, both for a screw motion. They are drawn stronger the nearer the singularity is; none
// before a person drives, as in the status: many robots are near one at home. Their labels go when the robot rests.

import { Group, Vector3 } from "three";
import { valueOf } from "../base/names.js";
import { Changes } from "./changes.js";
import { along, paint, twist, twoWays } from "../view/shapes.js";
import { COLOURS } from "../view/theme.js";

const WIDE = 5; // times the threshold: where it begins to show
const LABELLED = 1.5; // times the threshold: where it has a label
const SHARE = 0.3; // of a twist: a smaller part of it is not drawn
const SIZE = 0.2; // characteristic lengths

/** @type {Record<"type1" | "type2", { colour: number, label: string }>} */
export const KINDS = {
  type1: { colour: COLOURS.vermilion, label: "lost" },
  type2: { colour: COLOURS.purple, label: "uncontrolled" },
};

/** @typedef {import("../base/messages").SingularityReport} SingularityReport */
/**
 * @typedef {{ key: string, kind: "type1" | "type2", group: Group, paint: import("three").MeshBasicMaterial,
 *   arrow: Group, arc: Group }} Mark
 */

export class SingularMotions {
  /** @type {Map<string, Mark>} */
  #marks = new Map();
  #changes = new Changes();

  /** @param {{ view: View, session: Session, labels: Labels, aids: Aids }} parts */
  constructor({ view, session, labels, aids }) {
    this.view = view;
    this.session = session;
    this.labels = labels;
    this.aids = aids;
    session.on("report", () => this.#show());
    session.on("hello", () => this.#clear());
    aids.on("change", () => this.#show());
  }

  #clear() {
    for (const mark of this.#marks.values()) this.#hide(mark);
    this.#marks.clear();
    this.#changes.clear();
  }

  #show() {
    const { report } = this.session;
    const { still } = this.view.resolution;
    const driven = still || this.session.driven;
    const moves = still || this.session.tasks.length > 0 || Boolean(report?.moving || this.session.hello?.playback);
    for (const robot of this.session.robots) {
      for (const kind of /** @type {const} */ (["type1", "type2"])) {
        const singularity = valueOf(report?.robots, robot.name)?.[kind];
        const key = `${kind} ${robot.name}`;
        const near = this.aids.shows("singular") && driven ? closeness(singularity) : 0;
        const mark = this.#marks.get(key);
        if (!this.#changes.differs(key, near > 0 ? { singularity, moves } : null)) continue;
        if (near > 0 && singularity && singularity.twist?.length === 6 && singularity.position) {
          this.#place(mark ?? this.#make(key, kind), singularity, near, robot);
          const labelled = moves && singularity.sigma < LABELLED * (singularity.threshold ?? 0);
          this.labels.put(key, labelled ? (singularity.text ?? "") : "", new Vector3().fromArray(singularity.position), KINDS[kind].label);
        } else if (mark !== undefined) this.#hide(mark);
      }
    }
  }

  /** @param {Mark} mark */
  #hide(mark) {
    if (!mark.group.visible) return;
    mark.group.visible = false;
    this.labels.put(mark.key, "");
    this.view.changed();
  }

  /** @param {Mark} mark @param {SingularityReport} singularity @param {number} near @param {KnownRobot} robot */
  #place(mark, singularity, near, robot) {
    const straight = new Vector3().fromArray(singularity.twist, 0);
    const rotation = new Vector3().fromArray(singularity.twist, 3);
    const shares = [straight.length() / robot.length, rotation.length()];
    const most = Math.max(...shares) || 1;
    mark.group.visible = true;
    mark.group.position.fromArray(singularity.position);
    mark.group.scale.setScalar(SIZE * robot.length);
    mark.paint.opacity = 0.2 + 0.75 * near;
    mark.arrow.visible = shares[0] >= SHARE * most;
    mark.arc.visible = shares[1] >= SHARE * most;
    along(mark.arrow, straight);
    along(mark.arc, rotation);
    this.view.changed();
  }

  /** @param {string} key @param {"type1" | "type2"} kind @returns {Mark} */
  #make(key, kind) {
    const material = paint(KINDS[kind].colour);
    const [arrow, arc] = [twoWays(material), twist(material)];
    const mark = { key, kind, group: new Group(), paint: material, arrow, arc };
    mark.arc.scale.setScalar(0.7);
    mark.group.add(mark.arrow, mark.arc);
    this.view.stage.add(mark.group);
    this.#marks.set(key, mark);
    return mark;
  }
}

/**
 * Return 0 far from a singularity, to 1 at its threshold or below.
 * @param {SingularityReport | null | undefined} singularity
 */
function closeness(singularity) {
  if (!singularity || !(singularity.sigma >= 0) || !(singularity.threshold > 0)) return 0;
  const decades = Math.log((WIDE * singularity.threshold) / Math.max(singularity.sigma, 1e-12)) / Math.log(WIDE);
  return Math.min(1, Math.max(0, decades));
}
