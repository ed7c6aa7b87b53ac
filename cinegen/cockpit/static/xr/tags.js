// The page's labels as plates in the scene: distances to targets, and what the forecast meets.

import { Vector3 } from "three";
import { FONT, Plate } from "./plate.js";

const SIZE = 30; // pixels of a letter
const HIGH = 44; // pixels
const ANGLE = 0.028; // rad that a tag is high, wherever it is
const ASIDE = 0.7; // of its width: its middle from the point

/** @typedef {{ text: string, plate: Plate }} Tag */

export class Tags {
  /** @type {Map<string, Tag>} */
  #tags = new Map();

  /** @param {{ view: View, labels: Labels, world: World }} parts */
  constructor({ view, labels, world }) {
    this.view = view;
    this.labels = labels;
    this.world = world;
  }

  /** What they read. */
  get texts() {
    return [...this.#tags.values()].map(({ text }) => text);
  }

  /** @param {Vector3} head in the room */
  update(head) {
    for (const [key, { text, plate }] of this.#tags) {
      if (this.labels.all.get(key)?.text === text) continue;
      this.world.room.remove(plate.mesh);
      plate.dispose();
      this.#tags.delete(key);
    }
    for (const [key, { text, point }] of this.labels.all) {
      let tag = this.#tags.get(key);
      if (tag === undefined) this.#tags.set(key, (tag = { text, plate: this.#write(text) }));
      const at = this.view.stage.localToWorld(point.clone());
      const { canvas } = tag.plate;
      const wide = (ANGLE * at.distanceTo(head) * canvas.width) / canvas.height;
      const toward = at.clone().sub(head);
      const right = new Vector3(-toward.z, 0, toward.x).normalize();
      tag.plate.place(at.addScaledVector(right, ASIDE * wide), head, wide);
    }
  }

  /** Take them all away. */
  clear() {
    for (const { plate } of this.#tags.values()) {
      this.world.room.remove(plate.mesh);
      plate.dispose();
    }
    this.#tags.clear();
  }

  /** @param {string} text */
  #write(text) {
    const font = `${SIZE}px ${FONT}`;
    const ruler = /** @type {CanvasRenderingContext2D} */ (document.createElement("canvas").getContext("2d"));
    ruler.font = font;
    const plate = new Plate(Math.ceil(ruler.measureText(text).width) + 24, HIGH);
    plate.draw((context) => {
      context.fillStyle = "#171c22dd";
      context.fillRect(0, 0, plate.canvas.width, HIGH);
      context.font = font;
      context.textBaseline = "middle";
      context.fillStyle = "#e8ecf0";
      context.fillText(text, 12, HIGH / 2 + 1);
    });
    this.world.room.add(plate.mesh);
    return plate;
  }
}
