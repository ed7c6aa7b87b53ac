// The path ahead: where the tasks lead in the next moments, and what will be met there.

import {
  BufferGeometry,
  Float32BufferAttribute,
  Group,
  Line,
  LineBasicMaterial,
  Points,
  PointsMaterial,
  Vector3,
} from "three";
import { Fresh } from "./fresh.js";
import { ball, paint } from "../view/shapes.js";
import { COLOURS, theme } from "../view/theme.js";

const MOST = 4; // events that are marked
const APART = 0.05; // characteristic lengths: marks that are nearer to each other are one
const STILL = 0.01; // characteristic lengths: a shorter path is none
const COLOUR = {
  TYPE_1: COLOURS.vermillion,
  TYPE_2: COLOURS.purple,
  LIMIT: COLOURS.orange,
  STOPPED: COLOURS.vermillion,
};

export class Forecasts {
  #shown = new Map();
  #fresh = new Fresh();

  constructor({ view, session, labels, aids }) {
    Object.assign(this, { view, session, labels, aids });
    session.on("report", () => this.#show());
    session.on("hello", () => {
      for (const one of this.#shown.values()) this.#hide(one);
      this.#shown.clear();
      this.#fresh.clear();
    });
    aids.on("change", () => this.#show());
  }

  #show() {
    for (const robot of this.session.robots) {
      const found = this.aids.shows("forecast") ? this.session.report?.robots?.[robot.name]?.forecast : null;
      const one = this.#shown.get(robot.name);
      if (!this.#fresh.is(robot.name, found)) continue;
      const path = (found?.path ?? []).filter((point) => point?.length === 3);
      if (path.length > 1) this.#place(one ?? this.#make(robot.name), path, found.events ?? [], robot);
      else if (one !== undefined) this.#hide(one);
    }
  }

  #hide(one) {
    if (!one.group.visible) return;
    one.group.visible = false;
    one.marks.forEach((mark) => this.labels.put(mark.label, ""));
    this.view.changed();
  }

  #place(one, path, events, robot) {
    const points = path.map((point) => new Vector3().fromArray(point));
    const long = points.reduce((sum, point, i) => sum + (i > 0 ? point.distanceTo(points[i - 1]) : 0), 0);
    one.group.visible = true;
    one.line.visible = one.dots.visible = long > STILL * robot.length;
    one.paint.color.setHex(theme.accent);
    one.dotted.color.setHex(theme.accent);
    one.geometry.setAttribute("position", new Float32BufferAttribute(path.flat(), 3));
    const apart = [];
    for (const event of events) {
      if (!event?.position) continue;
      const at = new Vector3().fromArray(event.position);
      if (apart.length < MOST && apart.every(([, other]) => at.distanceTo(other) > APART * robot.length)) {
        apart.push([event, at]);
      }
    }
    one.marks.forEach((mark, i) => {
      const [event, at] = apart[i] ?? [];
      mark.ball.visible = event !== undefined && event.time > 0; // what is so already shows elsewhere
      if (mark.ball.visible) {
        mark.ball.position.copy(at);
        mark.ball.scale.setScalar(0.018 * robot.length);
        mark.paint.color.setHex(COLOUR[event.kind] ?? COLOURS.orange);
        mark.where.copy(at);
      }
      this.labels.put(mark.label, mark.ball.visible ? (event.text ?? "") : "", mark.where, "ahead");
    });
    this.view.changed();
  }

  #make(name) {
    const one = { group: new Group(), geometry: new BufferGeometry() };
    one.paint = new LineBasicMaterial({ transparent: true, opacity: 0.7, depthTest: false });
    one.dotted = new PointsMaterial({ size: 5, sizeAttenuation: false, transparent: true, depthTest: false });
    one.line = new Line(one.geometry, one.paint);
    one.dots = new Points(one.geometry, one.dotted);
    one.line.frustumCulled = one.dots.frustumCulled = false; // the path changes, its bounds would have to be kept
    one.marks = Array.from({ length: MOST }, (_, i) => {
      const material = paint(COLOURS.orange, { opacity: 0.95 });
      return { paint: material, ball: ball(material, 1), where: new Vector3(), label: `ahead ${name} ${i}` };
    });
    one.group.add(one.line, one.dots, ...one.marks.map((mark) => mark.ball));
    one.group.traverse((object) => {
      object.renderOrder = 9;
    });
    this.view.stage.add(one.group);
    this.#shown.set(name, one);
    return one;
  }
}
