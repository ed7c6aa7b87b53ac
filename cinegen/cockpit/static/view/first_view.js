// The first view: when the scene is complete, the robots fill it, or the camera is where the page's address has it. Then
// data-view on the root element is "ready". For some seconds the camera moves back when a robot leaves the view, unless the
// user has done something or prefers reduced motion; then only the user moves it.

import { Box3 } from "three";
import { cameraOf } from "../base/fragment.js";

const QUIET = 250; // ms without a command of the scene: it is there
const LATEST = 5000;
const WATCHED = 10000; // ms
const OFTEN = 100; // ms

/**
 * @param {import("./view.js").View} view
 * @param {import("../base/session.js").Session} session
 * @param {boolean} still pictures are taken from outside
 * @param {import("../map/field.js").Field} field map that is shown with a robot; it must be complete too
 */
export function frameFirstView(view, session, still, field) {
  const started = performance.now();
  let heard = -1;
  let since = 0;
  const timer = setInterval(() => {
    const now = performance.now();
    const { num_messages_received: count } = view.viewer;
    if (count !== heard) [heard, since] = [count, now];
    const late = now - started > LATEST;
    const complete = view.whole || now - since >= QUIET;
    if (session.state === null || !(view.placed || late) || !(field.ready || late) || !complete) return;
    clearInterval(timer);
    if (!still) {
      // else the camera is the server's
      const { camera } = cameraOf(location.hash);
      const shown = new Box3();
      view.frame(shown);
      view.keepCamera();
      if (camera !== null) view.setCamera(camera);
      else if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) keepInView(view, session, shown);
    }
    document.documentElement.dataset.view = "ready";
  }, 30);
}

/**
 * @param {import("./view.js").View} view
 * @param {import("../base/session.js").Session} session when its line is cut, everything is drawn again
 * @param {Box3} shown everything that was in the view
 */
function keepInView(view, session, shown) {
  const timer = setInterval(() => {
    if (!view.chosen) view.frame(shown);
  }, OFTEN);
  const stop = () => clearInterval(timer);
  setTimeout(stop, WATCHED);
  for (const event of /** @type {const} */ (["lost", "dropped"])) session.on(event, stop);
  for (const event of ["pointerdown", "wheel", "keydown"]) window.addEventListener(event, stop, { once: true });
}
