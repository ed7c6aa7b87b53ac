// Buttons that show the scene in a headset; each is there only if the browser has one.
//
// For tests: #enter-vr and #enter-ar; on the root element data-headset, the mode while it is shown.

import { byId } from "../base/dom.js";

const MODES = /** @type {const} */ ([["enter-vr", "immersive-vr"], ["enter-ar", "immersive-ar"]]);

/** @param {import("./presentation.js").Presentation} presentation @param {Session} session */
export function offer(presentation, session) {
  const { xr: system } = /** @type {{ xr?: import("./hand.js").System }} */ (/** @type {unknown} */ (navigator));
  const look = () => {
    for (const [id, mode] of MODES) {
      const show = (/** @type {boolean} */ supported) => {
        byId(id).hidden = !supported;
      };
      if (system === undefined) show(false);
      else system.isSessionSupported(mode).then(show, () => show(false)); // refused: a frame without permission
    }
  };
  for (const [id, mode] of MODES) {
    byId(id).addEventListener("click", () => {
      const done = presentation.shows ? presentation.end() : presentation.begin(mode);
      done.catch((/** @type {Error} */ error) => {
        session.emit("notice", { text: `The headset can't show the scene: ${error.message}`, level: "warning" });
      });
    });
  }
  presentation.on("begin", (mode) => {
    document.documentElement.dataset.headset = mode;
  });
  presentation.on("end", () => {
    delete document.documentElement.dataset.headset;
  });
  system?.addEventListener?.("devicechange", look);
  look();
}
