// What is under the pointer lights up and is named; so does what is held.

import { Vector3 } from "three";
import { theme } from "../view/theme.js";

/** @param {{ view: View, session: Session, labels: Labels, highlight: PartHighlight, drag: Drag }} parts */
export function hover({ view, session, labels, highlight, drag }) {
  const where = new Vector3();
  /** @param {Touched | null} part */
  const show = (part) => {
    if (part === null) {
      labels.put("over", "");
      return;
    }
    where.copy(view.root.worldToLocal(part.point.clone()));
    labels.put("over", session.called(part.robot, part.node), where, "over");
  };
  drag.on("hover", (part) => {
    show(part);
    session.emit("over", part);
  });
  session.on("over", (part) => highlight.light(part, theme.accent)); // a list may say so, too
  drag.on("fixed", (part) => {
    if (part === null) labels.put("over", "");
    else labels.put("over", "fixed", where.copy(view.root.worldToLocal(part.point.clone())), "over");
  });
  drag.on("drag", (part) => {
    highlight.light(part, theme.accent);
    labels.put("over", "");
    if (part === null) drag.over = null; // it is looked at anew
  });
}
