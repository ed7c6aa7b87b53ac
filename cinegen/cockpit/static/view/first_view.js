// The first view: when the scene is complete, the robots fill it, or the camera is where the page's address has it. Only
// then it is shown, and data-view on the root element is "ready". For some seconds the camera moves back when a robot leaves
// the view, at once and far enough where the user prefers reduced motion, until the user does something; then only the user moves it.

import { cameraOf } from "../base/fragment.js";

const LATEST = 5000; // ms for a map
const WATCHED = 10000; // ms
const OFTEN = 100; // ms
const FADE = 180; // ms

/**
 * @param {View} view
 * @param {Session} session
 * @param {boolean} still pictures are taken from outside
 * @param {Field} field map that is shown with a robot; it must be complete too
 */
export function frameFirstView(view, session, still, field) {
  const started = performance.now();
  const moves = !still && !window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  view.pane.style.visibility = "hidden";
  const timer = setInterval(() => {
    const late = performance.now() - started > LATEST;
    if (session.state === null || !view.whole || !(field.ready || late)) return;
    clearInterval(timer);
    const { camera } = cameraOf(location.hash);
    view.framed = true;
    view.frame();
    if (camera !== null) view.setCamera(camera);
    else if (!still) keepInView(view, session, !moves);
    view.last(show);
    view.changed();
  }, 30);
  let shown = false;
  const show = () => {
    if (shown) return;
    shown = true;
    view.pane.style.visibility = "";
    if (moves) view.pane.animate([{ opacity: 0 }, { opacity: 1 }], FADE);
    document.documentElement.dataset.view = "ready";
  };
}

/**
 * @param {View} view
 * @param {Session} session when its line is cut, everything is drawn again
 * @param {boolean} once the camera doesn't follow step by step
 */
function keepInView(view, session, once) {
  const timer = setInterval(() => {
    if (!view.chosen && view.headset === null) view.keep(once);
  }, OFTEN);
  const stop = () => clearInterval(timer);
  setTimeout(stop, WATCHED);
  for (const event of /** @type {const} */ (["lost", "dropped"])) session.on(event, stop);
  for (const event of ["pointerdown", "wheel", "keydown"]) window.addEventListener(event, stop, { once: true });
}
