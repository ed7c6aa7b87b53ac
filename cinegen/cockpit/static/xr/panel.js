// What a headset's panel reads: the status, the distances to singularities, who has control, the scale, the last notice,
// and what the buttons do. It is above the left hand, or above the only one.

import { Vector3 } from "three";
import { valueOf } from "../base/names.js";
import { significant } from "../base/units.js";
import { summary } from "../bar/status.js";
import { share, tone } from "../panel/singularity.js";
import { COLOURS } from "../view/theme.js";
import { FONT, Plate } from "./plate.js";

const WIDE = 0.3; // m
const ABOVE = 0.17; // m, its middle above the hand
const STAYS = 6000; // ms of a notice
const OFTEN = 100; // ms
const SIZE = { width: 640, height: 420 }; // pixels
const BAR = { x: 370, wide: 240 };
/** @type {Record<string, number>} */
const TONES = { good: COLOURS.green, warn: COLOURS.orange, bad: COLOURS.vermilion, none: 0x8a949e };
const METERS = /** @type {const} */ ([["type1", "lost DoF"], ["type2", "uncontrolled DoF"]]);
const DENIED = "Another user has control. Press A or X to take it.";
const VIEW_ONLY = "This page only shows the robots.";
const HELP = [
  "trigger, pinch: drag a point, or the world",
  "grip button: drag with orientation",
  "left stick: move; right: scale, rotate; press: fit",
  "A, X: undo, pin what is dragged; B, Y: ellipsoid",
];

/** @typedef {{ label: string, sigma: number, near: number }} Meter */

export class Panel {
  #drawn = "";
  #looked = -Infinity; // ms
  #notice = { text: "", until: 0 };
  plate = new Plate(SIZE.width, SIZE.height);

  /** @param {{ session: Session, world: World }} parts */
  constructor({ session, world }) {
    this.session = session;
    this.world = world;
    this.plate.mesh.visible = false;
    world.room.add(this.plate.mesh);
    session.on("notice", ({ text }) => this.#say(text));
    session.on("lost", () => this.#say("Connection lost, trying again."));
    session.on("dropped", (reason) => this.#say(`The server closed the connection: ${reason}`));
    session.on("denied", () => this.#say(session.viewOnly ? VIEW_ONLY : DENIED));
  }

  /** What it reads: status with its tone, meters, and lines of text. */
  get content() {
    const { session } = this;
    const { state, report, robots, obstacles, control } = session;
    const status = summary(state?.statuses ?? {}, report, robots.length + obstacles.length > 1);
    /** @type {Meter[]} */
    const meters = [];
    for (const [kind, label] of METERS) {
      const all = robots.map(({ name }) => valueOf(report?.robots, name)?.[kind] ?? null).filter((singularity) => singularity !== null);
      const nearest = all.filter(({ sigma }) => Number.isFinite(sigma)).sort((a, b) => a.sigma - b.sigma)[0];
      if (nearest !== undefined) meters.push({ label, sigma: nearest.sigma, near: nearest.threshold });
    }
    const scale = `scale ${significant(this.world.scale)} : 1`;
    const notice = performance.now() < this.#notice.until ? this.#notice.text : "";
    const who = control !== "other" ? "" : session.viewOnly ? VIEW_ONLY : DENIED;
    return { label: status?.label ?? "", tone: status?.tone ?? "none", meters, lines: [scale, notice || who] };
  }

  /** @param {Hand | null} hand @param {Vector3} head in the room */
  update(hand, head) {
    const now = performance.now();
    if (now - this.#looked > OFTEN) {
      this.#looked = now;
      const { content } = this;
      const text = JSON.stringify(content);
      if (text !== this.#drawn) this.plate.draw((context) => paint(context, content));
      this.#drawn = text;
    }
    const { middle } = this.world;
    const at = hand?.tracked ? hand.grip.clone() : middle.add(new Vector3(0, 0.4, 0));
    at.y += ABOVE;
    this.plate.place(at, head, WIDE);
    this.plate.mesh.visible = true;
  }

  /** @param {string} text */
  #say(text) {
    this.#notice = { text, until: performance.now() + STAYS };
  }
}

/** @param {CanvasRenderingContext2D} context @param {Panel["content"]} content */
function paint(context, { label, tone: mood, meters, lines }) {
  const { width, height } = SIZE;
  context.fillStyle = "#171c22ee";
  context.fillRect(0, 0, width, height);
  context.fillStyle = css(TONES[mood]);
  context.fillRect(0, 0, 14, height);
  context.textBaseline = "middle";
  /**
   * @param {string} text
   * @param {number} x
   * @param {number} y
   * @param {number} size
   * @param {string} colour
   * @param {number} room pixels, into which a long text is squeezed
   */
  const write = (text, x, y, size, colour = "#e8ecf0", room = width - x - 16) => {
    context.font = `${size}px ${FONT}`;
    context.fillStyle = colour;
    context.fillText(text, x, y, room);
  };
  write(label, 34, 48, 44);
  meters.forEach(({ label: name, sigma, near }, i) => {
    const y = 110 + 48 * i;
    write(`${name} ${significant(sigma)}`, 34, y, 28, "#e8ecf0", BAR.x - 48);
    context.fillStyle = "#39424d";
    context.fillRect(BAR.x, y - 11, BAR.wide, 22);
    context.fillStyle = css(TONES[tone(sigma, near)]);
    context.fillRect(BAR.x, y - 11, BAR.wide * share(sigma), 22);
    context.fillStyle = "#e8ecf0";
    context.fillRect(BAR.x + BAR.wide * share(near), y - 16, 3, 32);
  });
  lines.forEach((text, i) => write(text, 34, 204 + 38 * i, 27, i === 0 ? "#a9b6c3" : "#e69f00"));
  HELP.forEach((text, i) => write(text, 34, 292 + 34 * i, 25, "#a9b6c3"));
}

/** @param {number} colour */
function css(colour) {
  return `#${colour.toString(16).padStart(6, "0")}`;
}
