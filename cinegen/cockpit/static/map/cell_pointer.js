// Cells under the pointer: the legend shows their values, and a click moves the robot there.
//
// On the root element, for tests: data-cell, the number in the map of the cell under the pointer; else it is not there.

import { Box3, Mesh, MeshBasicMaterial, SphereGeometry, Vector3 } from "three";
import { theme } from "../view/theme.js";
import { got } from "./field.js";
import { formatted } from "./numbers.js";

const MARK = 0.62; // of a cell's width: a cell that is pointed at

/**
 * @param {{ view: View, session: Session, labels: Labels, field: Field,
 *   cells: import("./cells.js").Cells, legend: import("./legend.js").Legend, drag: Drag,
 *   pick: import("../pointer/pick.js").Pick }} parts
 */
export function pointAtCells({ view, session, labels, field, cells, legend, drag, pick }) {
  const material = new MeshBasicMaterial({ color: theme.accent, transparent: true, opacity: 0.75, depthTest: false });
  const mark = new Mesh(new SphereGeometry(0.5, 24, 16), material);
  mark.visible = false;
  mark.renderOrder = 1;
  view.stage.add(mark);
  const where = new Vector3();
  /** @type {number | null} */
  let over = null;
  let asked = 0;

  /** @param {number | null} cell */
  const point = (cell) => {
    if (cell !== null) view.canvas.style.cursor = "pointer";
    if (cell === over) return;
    over = cell;
    mark.visible = cell !== null;
    const root = document.documentElement;
    if (cell === null) {
      delete root.dataset.cell;
      labels.put("cell", "");
    } else {
      root.dataset.cell = String(field.array("numbers")[cell]);
      cells.middle(cell, where);
      mark.position.copy(where);
      mark.scale.setScalar(MARK * (field.about?.size ?? 0));
      material.color.setHex(theme.accent);
      const described = field.description();
      labels.put("cell", described === null ? "go there" : `${described.name} ${formatted(field.values()?.[cell] ?? NaN, described.unit)}`, where, "cell");
    }
    legend.point(cell);
    view.changed();
  };

  /** @param {number} cell */
  const go = async (cell) => {
    if (!session.mayAct()) return;
    asked += 1;
    const mine = asked;
    try {
      const to = await (await got(`map/cell/${field.array("numbers")[cell]}`)).json();
      if (mine === asked) session.send({ type: "move_to", ...to }); // else another was clicked meanwhile
    } catch (error) {
      session.emit("notice", { text: `The cell can't be read: ${error instanceof Error ? error.message : error}`, level: "warning" });
    }
  };

  pick.veil = (ray, away) => (cells.met(ray)?.away ?? Infinity) < away;
  drag.on("point", (event) => point(event === null ? null : (cells.met(pick.aim(event))?.cell ?? null)));
  drag.on("drag", () => point(null));
  drag.on("free", (event) => {
    const met = session.hello?.playback ? null : cells.met(pick.aim(event));
    if (met !== null) go(met.cell);
  });
  field.on("change", () => point(null));
  field.on("cells", () => point(null));
  view.also = (box) => {
    if (field.about === null || !field.shown || field.about.shown === 0) return;
    const all = new Box3();
    for (let cell = 0; cell < field.about.shown; cell += 1) all.expandByPoint(cells.middle(cell, where));
    box.union(all.applyMatrix4(view.stage.matrix));
  };
}
