// Sends the orientation of the camera to the server while the command frame is the view.

import { Quaternion } from "three";
import { atMostEvery } from "../base/dom.js";

const OFTEN = 100; // ms
const TURNED = 1e-5;

/** @param {View} view @param {Session} session */
export function sendCamera(view, session) {
  /** @type {Quaternion | null} */
  let sent = null;
  const send = atMostEvery(OFTEN, () => {
    if (session.report?.settings?.frame !== "view") return;
    const orientation = view.cameraOrientation(new Quaternion()).normalize();
    if (sent !== null && 1 - Math.abs(sent.dot(orientation)) < TURNED ** 2) return;
    sent = orientation;
    session.send({ type: "set_view", quaternion: /** @type {[number, number, number, number]} */ (orientation.toArray()) });
  });
  view.before(() => send());
  session.on("report", () => send());
  session.on("hello", () => {
    sent = null;
  });
}
