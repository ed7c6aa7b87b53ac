// The scene in a headset: a session of WebXR, from its beginning to its end. Its frames are those of the whole page; the
// page is as it was when the session has ended.
//
// Events: begin (mode), end.

import { PerspectiveCamera, Quaternion, Vector3 } from "three";
import { Events } from "../base/events.js";
import { frames } from "../base/frames.js";
import { put } from "./hand.js";
import { Hands } from "./hands.js";
import { Panel } from "./panel.js";
import { Tags } from "./tags.js";
import { HandDrags } from "./hand_drags.js";
import { Travel } from "./travel.js";
import { World } from "./world.js";

const NEAR = 0.02; // m
const FAR = 100;
const LONGEST = 0.1; // s, of one frame
const USUAL = 90; // Hz, if the headset does not report its own
const LEAST = 60; // Hz that can be asked for
const MOST = 120;

/** @typedef {"immersive-vr" | "immersive-ar"} Mode */
/** @typedef {import("three").XRSession & { frameRate?: number }} HeadsetSession */

/** @extends {Events<{ begin: Mode, end: undefined }>} */
export class Presentation extends Events {
  /** @type {HeadsetSession | null} */
  #headset = null;
  #last = 0; // ms
  #placed = false;
  #head = new Vector3();
  #gaze = new Quaternion();

  /**
   * @param {{ view: View, session: Session,
   *   pick: import("../pointer/pick.js").Pick, labels: Labels,
   *   aids: Aids, endDrag: () => unknown }} parts
   */
  constructor({ view, session, pick, labels, aids, endDrag }) {
    super();
    this.view = view;
    this.session = session;
    this.aids = aids;
    this.endDrag = endDrag;
    this.camera = new PerspectiveCamera(70, 1, NEAR, FAR);
    this.world = new World(view);
    this.hands = new Hands(this.world.room);
    this.handDrags = new HandDrags({ session, view, pick, hands: this.hands, world: this.world });
    this.travel = new Travel({ hands: this.hands, world: this.world, handDrags: this.handDrags });
    this.panel = new Panel({ session, world: this.world });
    this.tags = new Tags({ view, labels, world: this.world });
    session.on("hello", () => this.#ask());
  }

  /** Whether a headset shows the scene. */
  get shows() {
    return this.#headset !== null;
  }

  /** Begin a session; called by what a user does. @param {Mode} mode */
  async begin(mode) {
    const { xr: system } = /** @type {{ xr?: import("./hand.js").System }} */ (/** @type {unknown} */ (navigator));
    if (system === undefined || this.shows) return;
    const { renderer } = this.view.viewer;
    const headset = /** @type {HeadsetSession} */ (
      await system.requestSession(mode, { requiredFeatures: ["local-floor"], optionalFeatures: ["hand-tracking"] })
    );
    this.#headset = headset;
    headset.addEventListener("end", () => this.#end());
    this.endDrag();
    this.session.select(null, null);
    renderer.xr.enabled = true;
    renderer.xr.setReferenceSpaceType("local-floor");
    try {
      await renderer.xr.setSession(headset);
    } catch (error) {
      await headset.end();
      throw error;
    }
    this.hands.begin(headset, /** @type {EventTarget} */ (renderer.xr.getReferenceSpace()));
    this.view.headset = this.camera;
    this.#placed = false;
    this.#last = performance.now();
    frames.stop();
    renderer.setAnimationLoop((now, frame) => {
      if (frame !== undefined && this.shows) this.#draw(now, frame);
    });
    this.#ask();
    this.emit("begin", mode);
  }

  /** End the session, if there is one. */
  async end() {
    await this.#headset?.end();
  }

  /** Ask for as many states as the headset shows; for the usual number without one. */
  #ask() {
    if (this.#headset !== null) this.session.send({ type: "request_rate", rate: Math.min(MOST, Math.max(LEAST, this.#headset.frameRate ?? USUAL)) });
  }

  #end() {
    const { view } = this;
    const { renderer } = view.viewer;
    this.#headset = null;
    this.hands.end(); // and their drags
    this.tags.clear();
    renderer.setAnimationLoop(null);
    renderer.xr.enabled = false;
    this.world.restore();
    view.headset = null;
    view.viewer.scene_tree.find(["Background"]).on_update();
    setTimeout(() => { // three.js hears of the end after this, and keeps the size until then
      view.fit();
      view.changed();
    });
    this.session.send({ type: "request_rate", rate: null });
    frames.resume();
    this.emit("end");
  }

  /** @param {number} now ms @param {import("three").XRFrame} frame */
  #draw(now, frame) {
    const dt = Math.min(LONGEST, Math.max(0, (now - this.#last) / 1000));
    this.#last = now;
    frames.run(now);
    const { view, world, hands } = this;
    const space = view.viewer.renderer.xr.getReferenceSpace();
    const pose = space === null ? undefined : frame.getViewerPose(space);
    if (!pose) return; // the headset does not know where it is
    put(pose.transform, this.#head, this.#gaze);
    const toward = new Vector3(0, 0, -1).applyQuaternion(this.#gaze);
    if (!this.#placed) world.place(this.#head, toward);
    this.#placed = true;
    hands.read(frame);
    for (const hand of hands.all) this.#click(hand, toward);
    this.travel.update(dt, toward);
    this.handDrags.update(dt);
    this.panel.update(hands.other, this.#head);
    this.tags.update(this.#head);
    if (frame.session.environmentBlendMode !== "opaque") view.viewer.scene.background = null;
    view.drawForHeadset();
  }

  /** @param {Hand} hand @param {Vector3} toward */
  #click(hand, toward) {
    if (hand.clicked("lower")) {
      if (this.session.viewOnly) this.session.mayAct();
      else if (this.session.control === "other") this.session.send({ type: "request_control", on: true });
      else if (this.handDrags.has(hand)) this.handDrags.end(hand, true);
      else this.session.send({ type: "undo" });
    }
    if (hand.clicked("upper")) this.aids.choose("ellipsoid", !this.aids.shows("ellipsoid"));
    if (hand.clicked("stick")) this.world.place(this.#head, toward);
  }
}
