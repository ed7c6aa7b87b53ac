// Start the cockpit where the browser draws 3D graphics; elsewhere the page tells what is missing.
//
// For tests: #cover.

import { byId } from "./base/dom.js";

const MISSING =
  "This browser draws no 3D graphics (WebGL): switch on hardware acceleration in its settings and load the page again, " +
  "or open it in another browser.";

/** Return whether a scene can be drawn. */
function draws() {
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("webgl2") ?? canvas.getContext("webgl");
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return context !== null;
}

try {
  await import("./cockpit.js");
} catch (error) {
  if (draws()) throw error;
  for (const part of document.querySelectorAll("#bar > :not(#title), #panel, #foot")) part.remove(); // they would do nothing
  document.querySelector("main")?.style.setProperty("grid-template-columns", "minmax(0, 1fr)");
  byId("cover").textContent = MISSING;
  byId("cover").hidden = false;
}
