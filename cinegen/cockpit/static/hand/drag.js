// The ball-and-plane drag: a part is taken where it is touched, and led in the plane of the view through that point.
// It turns freely meanwhile. A press and release without a drag selects the part.
//
// Events: hover (part or null), drag (part or null), free (the event: a pointer that touches no part was pressed and
// released), point (where a pointer is that touches no part; null if there is none).

import { Plane, Vector3 } from "three";
import { Events } from "../base/events.js";
import { Lead } from "./lead.js";

const STILL = 4; // pixels: a pointer that moves less has not moved
const STILL_TOUCH = 8; // a finger is broad

/**
 * @typedef {import("./pick.js").Touched} Touched
 * @typedef {import("./pick.js").At} At
 * @typedef {Touched & { at: Vector3, pointer: number, x: number, y: number, dragged: boolean, denied: boolean,
 *   still: number }} Held
 */

/** @extends {Events<{ hover: Touched | null, drag: Held | null, free: PointerEvent, point: At | null }>} */
export class Drag extends Events {
  #plane = new Plane();
  /** @type {Held | null} */
  #held = null; // what is pressed, and whether it is dragged yet
  /** @type {{ x: number, y: number } | null} */
  #beside = null; // where the pointer was pressed beside all parts
  /** @type {At | null} */
  #pointer = null; // where it hovers
  #waiting = false; // for the next picture, to look what is there
  /** @type {Touched | null} */
  over = null;

  /**
   * @param {{ view: import("../view/view.js").View, session: import("../base/session.js").Session, pick: import("./pick.js").Pick,
   *   gizmo: { wants: (event: PointerEvent) => boolean, busy: boolean, hovered: boolean } }} parts
   */
  constructor({ view, session, pick, gizmo }) {
    super();
    this.view = view;
    this.session = session;
    this.pick = pick;
    this.gizmo = gizmo;
    this.lead = new Lead(session);
    const { canvas } = view;
    canvas.style.touchAction = "none";
    canvas.addEventListener("pointerdown", (event) => this.#press(event), true);
    canvas.addEventListener("pointermove", (event) => this.#move(event), true);
    canvas.addEventListener("pointerrawupdate", (event) => this.#follow(/** @type {PointerEvent} */ (event)));
    for (const end of /** @type {const} */ (["pointerup", "pointercancel", "lostpointercapture"])) {
      view.pane.addEventListener(end, (event) => this.#release(event), true); // the view takes it there to turn
    }
    canvas.addEventListener("pointerleave", () => this.#point(null));
    this.on("drag", (part) => canvas.classList.toggle("dragging", part !== null));
  }

  /** What is dragged now; null if nothing. */
  get part() {
    return this.#held?.dragged ? this.#held : null;
  }

  /** Lets go; pinned where the target is, if so wished. */
  letGo(pin = false) {
    const held = this.#held;
    this.#held = null;
    this.lead.stop();
    if (held === null) return;
    if (this.view.canvas.hasPointerCapture(held.pointer)) this.view.canvas.releasePointerCapture(held.pointer);
    if (!held.dragged) return;
    this.session.send({ "let go": pin ? "pin" : true });
    this.tell("drag", null);
  }

  /** @param {PointerEvent} event */
  #press(event) {
    this.#beside = null;
    if (this.#held !== null) {
      event.stopImmediatePropagation(); // a second finger while a part is held
      return;
    }
    if (!event.isPrimary || event.button !== 0 || this.gizmo.wants(event)) return;
    const hit = this.pick.near(event);
    if (hit === null) {
      this.#beside = { x: event.clientX, y: event.clientY };
      return;
    }
    event.stopImmediatePropagation(); // the view stays where it is
    this.view.canvas.setPointerCapture(event.pointerId);
    const toward = this.view.camera.getWorldDirection(new Vector3());
    this.#plane.setFromNormalAndCoplanarPoint(toward, hit.point);
    const at = hit.group.worldToLocal(hit.point.clone());
    this.#held = {
      ...hit,
      at,
      pointer: event.pointerId,
      x: event.clientX,
      y: event.clientY,
      dragged: false,
      denied: false,
      still: event.pointerType === "touch" ? STILL_TOUCH : STILL,
    };
  }

  /** @param {PointerEvent} event */
  #move(event) {
    if (this.#held === null) {
      if (event.buttons === 0) this.#point(event);
      return;
    }
    event.stopImmediatePropagation();
    this.#follow(event);
  }

  /** @param {PointerEvent} event */
  #follow(event) {
    const held = this.#held;
    if (held === null || event.pointerId !== held.pointer || held.denied) return;
    if (!held.dragged) {
      if (Math.hypot(event.clientX - held.x, event.clientY - held.y) <= held.still) return;
      if (!this.session.mayAct()) {
        held.denied = true;
        return;
      }
      held.dragged = true;
      this.session.send({ take: { robot: held.robot, node: held.node, point: held.at.toArray() } });
      this.tell("drag", held);
    }
    const met = this.pick.aim(event).intersectPlane(this.#plane, new Vector3());
    if (met !== null) this.lead.to(this.view.root.worldToLocal(met).toArray());
  }

  /** @param {PointerEvent} event */
  #release(event) {
    const held = this.#held;
    if (held !== null && event.pointerId === held.pointer) {
      const clicked = event.type === "pointerup" && !held.dragged && !held.denied;
      event.stopImmediatePropagation();
      this.letGo();
      if (clicked) this.session.select(held.robot, held.node);
      return;
    }
    const beside = this.#beside;
    this.#beside = null;
    if (beside === null || event.type !== "pointerup") return;
    if (Math.hypot(event.clientX - beside.x, event.clientY - beside.y) <= STILL) this.tell("free", event);
  }

  /** @param {PointerEvent | null} event */
  #point(event) {
    this.#pointer = event === null ? null : { clientX: event.clientX, clientY: event.clientY };
    if (this.#waiting) return;
    this.#waiting = true;
    requestAnimationFrame(() => {
      this.#waiting = false;
      this.#hover();
    });
  }

  #hover() {
    const busy = this.#held !== null || this.gizmo.busy;
    if (busy) return;
    const pointer = this.gizmo.hovered ? null : this.#pointer;
    const hit = pointer === null ? null : this.pick.seen(pointer);
    this.view.canvas.style.cursor = this.gizmo.hovered ? "move" : hit === null ? "" : "grab";
    this.tell("point", hit !== null ? null : pointer);
    if (hit?.robot === this.over?.robot && hit?.node === this.over?.node) return;
    this.over = hit;
    this.tell("hover", hit);
  }
}
