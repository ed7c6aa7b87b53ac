// The path ahead: where the tasks lead in the next moments, and what will be met there.

import {
  BufferGeometry, Float32BufferAttribute, Group, Line, LineBasicMaterial, Points, PointsMaterial, Vector3,
} from "three";
import { valueOf } from "../base/names.js";
import { Changes } from "./changes.js";
import { ball, paint } from "../view/shapes.js";
import { COLOURS, theme } from "../view/theme.js";

const MOST = 4; // events that are marked
const APART = 0.05; // characteristic lengths: marks that are nearer to each other are one
const STILL = 0.01; // characteristic lengths: a shorter path is none
/** @type {Record<string, number>} */
const COLOUR = { TYPE_1: COLOURS.vermilion, TYPE_2: COLOURS.purple, LIMIT: COLOURS.orange, STOPPED: COLOURS.vermilion };

/** @typedef {import("../base/messages").ForecastEvent} ForecastEvent */
/** @typedef {{ paint: import("three").MeshBasicMaterial, ball: import("three").Mesh, where: Vector3, label: string }} Mark */
/**
 * @typedef {{ group: Group, geometry: BufferGeometry, paint: LineBasicMaterial, dotted: PointsMaterial, line: Line,
 *   dots: Points, marks: Mark[] }} Drawn
 */

export class Forecasts {
  /** @type {Map<string, Drawn>} */
  #shown = new Map();
  #changes = new Changes();

  /** @param {{ view: View, session: Session, labels: Labels, aids: Aids }} parts */
  constructor({ view, session, labels, aids }) {
    this.view = view;
    this.session = session;
    this.labels = labels;
    this.aids = aids;
    session.on("report", () => this.#show());
    session.on("hello", () => {
      for (const drawn of this.#shown.values()) this.#hide(drawn);
      this.#shown.clear();
      this.#changes.clear();
    });
    aids.on("change", () => this.#show());
  }

  #show() {
    for (const robot of this.session.robots) {
      const forecast = this.aids.shows("forecast") ? valueOf(this.session.report?.robots, robot.name)?.forecast : null;
      const drawn = this.#shown.get(robot.name);
      if (!this.#changes.differs(robot.name, forecast)) continue;
      const path = (forecast?.path ?? []).filter((point) => point?.length === 3);
      if (path.length > 1) this.#place(drawn ?? this.#make(robot.name), path, forecast?.events ?? [], robot);
      else if (drawn !== undefined) this.#hide(drawn);
    }
  }

  /** @param {Drawn} drawn */
  #hide(drawn) {
    if (!drawn.group.visible) return;
    drawn.group.visible = false;
    drawn.marks.forEach((mark) => this.labels.put(mark.label, ""));
    this.view.changed();
  }

  /** @param {Drawn} drawn @param {number[][]} path @param {ForecastEvent[]} events @param {KnownRobot} robot */
  #place(drawn, path, events, robot) {
    const driven = this.view.resolution.still || this.session.driven; // before, the robot is alone
    const points = path.map((point) => new Vector3().fromArray(point));
    const long = points.reduce((sum, point, i) => sum + (i > 0 ? point.distanceTo(points[i - 1]) : 0), 0);
    drawn.group.visible = true;
    drawn.line.visible = drawn.dots.visible = long > STILL * robot.length;
    drawn.paint.color.setHex(theme.accent);
    drawn.dotted.color.setHex(theme.accent);
    drawn.geometry.setAttribute("position", new Float32BufferAttribute(path.flat(), 3));
    /** @type {[ForecastEvent, Vector3][]} */
    const apart = [];
    for (const event of events) {
      if (!event?.position) continue;
      const at = new Vector3().fromArray(event.position);
      if (apart.length < MOST && apart.every(([, other]) => at.distanceTo(other) > APART * robot.length)) {
        apart.push([event, at]);
      }
    }
    drawn.marks.forEach((mark, i) => {
      const [event, at] = apart[i] ?? [null, null];
      mark.ball.visible = driven && event !== null && event.time > 0; // a present event shows elsewhere
      if (mark.ball.visible && event !== null && at !== null) {
        mark.ball.position.copy(at);
        mark.ball.scale.setScalar(0.018 * robot.length);
        mark.paint.color.setHex(COLOUR[event.kind] ?? COLOURS.orange);
        mark.where.copy(at);
      }
      this.labels.put(mark.label, mark.ball.visible ? (event?.text ?? "") : "", mark.where, "ahead");
    });
    this.view.changed();
  }

  /** @param {string} name @returns {Drawn} */
  #make(name) {
    const [group, geometry] = [new Group(), new BufferGeometry()];
    const inked = new LineBasicMaterial({ transparent: true, opacity: 0.7, depthTest: false });
    const dotted = new PointsMaterial({ size: 5, sizeAttenuation: false, transparent: true, depthTest: false });
    const line = new Line(geometry, inked);
    const dots = new Points(geometry, dotted);
    line.frustumCulled = dots.frustumCulled = false; // the path changes, its bounds would have to be kept
    const marks = Array.from({ length: MOST }, (_, i) => {
      const material = paint(COLOURS.orange, { opacity: 0.95 });
      return { paint: material, ball: ball(material, 1), where: new Vector3(), label: `ahead ${name} ${i}` };
    });
    group.add(line, dots, ...marks.map((mark) => mark.ball));
    group.traverse((object) => {
      object.renderOrder = 9;
    });
    this.view.stage.add(group);
    const drawn = { group, geometry, paint: inked, dotted, line, dots, marks };
    this.#shown.set(name, drawn);
    return drawn;
  }
}
