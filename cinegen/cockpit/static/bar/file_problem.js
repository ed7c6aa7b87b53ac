// What is wrong with the robots' files, which were saved, over the scene: the robots as they were read before are driven
// on. It goes when the files are saved without errors.
//
// For tests: #file-problem, hidden while nothing is wrong.

import { byId, make } from "../base/dom.js";

const BLOCK = /(?: {4}.*\n?)+|.+\n?/g; // lines of the file with the marks below them, or a line about them

/** @param {Session} session */
export function showProblems(session) {
  const place = byId("file-problem");
  session.on("problem", (text) => {
    place.hidden = text === "";
    const blocks = (text.match(BLOCK) ?? []).map((block) => make(block.startsWith("    ") ? "pre" : "p", {}, block));
    place.replaceChildren(make("h2", {}, "The saved file has errors. You still drive the robot as it was before."), ...blocks);
  });
}
