// What is wrong with the robots' files, which were saved, over the scene: the robots as they were read before are driven
// on. It goes when the files are saved without errors.
//
// For tests: #file-problem, hidden while nothing is wrong.

import { byId, make } from "../base/dom.js";

/** @param {import("../base/session.js").Session} session */
export function showProblems(session) {
  const place = byId("file-problem");
  session.on("problem", (text) => {
    place.hidden = text === "";
    place.replaceChildren();
    if (text === "") return;
    const lines = make("pre", { tabindex: 0 }, text);
    place.append(make("p", {}, "The saved file has errors. You still drive the robot as it was before:"), lines);
  });
}
