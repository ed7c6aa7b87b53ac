// Tells the server how the camera stands, while commands are meant along its axes.

import { Quaternion } from "three";
import { atMostEvery } from "../base/dom.js";

const OFTEN = 100; // ms
const TURNED = 1e-5;

/**
 * @param {import("./view.js").View} view
 * @param {import("../base/session.js").Session} session
 */
export function tellEye(view, session) {
  /** @type {Quaternion | null} */
  let told = null;
  const tell = atMostEvery(OFTEN, () => {
    if (session.report?.settings?.frame !== "view") return;
    const eye = view.eye(new Quaternion()).normalize();
    if (told !== null && 1 - Math.abs(told.dot(eye)) < TURNED ** 2) return;
    told = eye;
    session.send({ type: "set_view", quaternion: /** @type {[number, number, number, number]} */ (eye.toArray()) });
  });
  view.before(() => tell());
  session.on("report", () => tell());
  session.on("hello", () => {
    told = null;
  });
}
