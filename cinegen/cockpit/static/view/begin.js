// The first view: as soon as the scene is there, the robots fill it. From then on data-view on the root element is
// "ready", and nothing moves the camera but the person.

const QUIET = 250; // ms without a command of the scene: it is there
const LATEST = 5000;

/**
 * @param {import("./view.js").View} view
 * @param {import("../base/session.js").Session} session
 * @param {boolean} still pictures are taken from outside
 * @param {import("../map/field.js").Field} field the map that is shown beside a robot: it is waited for, too
 */
export function begin(view, session, still, field) {
  const started = performance.now();
  let heard = -1;
  let since = 0;
  const timer = setInterval(() => {
    const now = performance.now();
    const { num_messages_received: count } = view.viewer;
    if (count !== heard) [heard, since] = [count, now];
    const placed = view.root.scale.x !== 1 || now - started > LATEST; // the scene's scale comes after its objects
    const late = now - started > LATEST;
    if (session.state === null || !placed || !(field.ready || late) || now - since < QUIET) return;
    clearInterval(timer);
    if (!still) {
      // else the camera is the server's
      view.frame();
      view.keepCamera();
    }
    document.documentElement.dataset.view = "ready";
  }, 30);
}
