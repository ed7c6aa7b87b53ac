// Keys, as people who know three.js have them. A control that has the focus keeps the keys it needs.

import { byId } from "../base/dom.js";
import { selectNext } from "../pointer/arrow_keys.js";

const TYPED = "input:not([type=checkbox]):not([type=range]), textarea, select";
const PRESSED = "button, summary, a, input[type=checkbox], select, [tabindex]:not(canvas)";

/**
 * @param {{ commands: import("./commands.js").Commands, drawer: { toggle: () => void }, session: Session,
 *   gizmo: { setMode: (mode: string) => void, setAxes: () => void }, view: View,
 *   measure: { toggle: (on?: boolean) => boolean }, partTasks: { stop: () => boolean }, endDrag: () => boolean, pin: () => void,
 *   look: () => void }} parts
 */
export function keys({ commands, drawer, gizmo, session, view, measure, partTasks, endDrag, pin, look }) {
  /** @param {string} mode */
  const move = (mode) => {
    gizmo.setMode(mode);
    if (session.selected !== null) view.canvas.focus({ preventScroll: true }); // for the arrow keys
  };
  /** @type {Record<string, (event: KeyboardEvent) => void>} */
  const plain = {
    w: () => move("translate"),
    e: () => move("rotate"),
    n: ({ shiftKey }) => selectNext(session, shiftKey ? -1 : 1),
    q: () => gizmo.setAxes(),
    m: () => measure.toggle(),
    p: pin,
    l: look,
    h: () => commands.home(),
    f: () => view.frame(),
    t: () => drawer.toggle(),
    "?": () => commands.help(),
  };
  window.addEventListener("keydown", (event) => {
    if (/** @type {HTMLDialogElement} */ (byId("keys")).open) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (key === "Escape") {
      if (!endDrag() && !partTasks.stop() && !measure.toggle(false)) session.select(null, null);
      return;
    }
    const typing = event.target instanceof Element && event.target.closest(TYPED) !== null;
    if (typing || event.altKey) return;
    if (event.ctrlKey || event.metaKey) {
      if (key === "z" && event.shiftKey) commands.redo();
      else if (key === "z") commands.undo();
      else if (key === "y") commands.redo();
      else return;
      event.preventDefault();
      return;
    }
    if (key === " ") {
      if (event.target instanceof Element && event.target.closest(PRESSED) !== null) return;
      event.preventDefault();
      if (!event.repeat) commands.pause();
      return;
    }
    if (plain[key] === undefined || event.repeat) return;
    event.preventDefault();
    plain[key](event);
  });
}
