// Drag of a point of a part, in the plane of the view through that point. The part rotates freely about it. A press and
// release without a drag selects the part.
//
// A fixed part is not dragged: "fixed" tells so. A finger that rests on a part selects it. Two fingers zoom, and move the view: they
// rotate it where the first is on a part, which one finger would drag, and shift it otherwise.
//
// Events: hover (part or null), fixed (part, or null when it is let go), drag (part or null), free (the event: a pointer that touches no part was pressed and
// released), point (where a pointer is that touches no part; null if there is none).

import { Plane, Vector3 } from "three";
import { Events } from "../base/events.js";
import { DragTarget } from "./drag_target.js";

const STILL = 4; // pixels: a pointer that moves less has not moved
const STILL_TOUCH = 8; // a finger is broad
const LONG = 500; // ms
const [SHIFT, ROTATE] = [2, 3]; // TOUCH.DOLLY_PAN and TOUCH.DOLLY_ROTATE of three.js

/**
 * @typedef {Touched & { at: Vector3, pointer: number, x: number, y: number, dragged: boolean, denied: boolean,
 *   still: number, began: PointerEvent }} Press
 */

/** @extends {Events<{ hover: Touched | null, fixed: Touched | null, drag: Press | null, free: PointerEvent, point: At | null }>} */
export class Drag extends Events {
  #plane = new Plane();
  /** @type {Press | null} */
  #press = null; // what is pressed, and whether it is dragged yet
  /** @type {{ x: number, y: number } | null} */
  #beside = null; // where the pointer was pressed beside all parts
  /** @type {At | null} */
  #pointer = null; // where it hovers
  #waiting = false; // for the next picture, to look what is there
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #long; // until a finger has rested for long
  /** @type {PointerEvent | null} */
  #given = null; // the press that the view has got
  /** @type {Touched | null} */
  over = null;

  /**
   * @param {{ view: View, session: Session, pick: import("./pick.js").Pick,
   *   gizmo: { busy: boolean, hovered: boolean } }} parts
   */
  constructor({ view, session, pick, gizmo }) {
    super();
    this.view = view;
    this.session = session;
    this.pick = pick;
    this.gizmo = gizmo;
    this.target = new DragTarget(session);
    const { canvas } = view;
    canvas.style.touchAction = "none";
    canvas.addEventListener("pointerdown", (event) => this.#down(event), true);
    canvas.addEventListener("pointermove", (event) => this.#move(event), true);
    canvas.addEventListener("pointerrawupdate", (event) => this.#follow(/** @type {PointerEvent} */ (event)));
    for (const end of /** @type {const} */ (["pointerup", "pointercancel", "lostpointercapture"])) {
      view.pane.addEventListener(end, (event) => this.#release(event), true); // the view takes it there to turn
    }
    canvas.addEventListener("pointerleave", () => this.#point(null));
    this.on("drag", (part) => canvas.classList.toggle("dragging", part !== null));
  }

  /** The part that is dragged; null if none. */
  get part() {
    return this.#press?.dragged ? this.#press : null;
  }

  /** End the drag; with a pin at the target, if wanted. */
  end(pin = false) {
    const press = this.#press;
    this.#press = null;
    this.target.stop();
    clearTimeout(this.#long);
    if (press === null) return;
    if (press.denied) this.emit("fixed", null);
    if (this.view.canvas.hasPointerCapture(press.pointer)) this.view.canvas.releasePointerCapture(press.pointer);
    if (!press.dragged) return;
    this.session.send({ type: "end_drag", pin });
    this.emit("drag", null);
  }

  /** @param {PointerEvent} event */
  #down(event) {
    this.#beside = null;
    if (event !== this.#given) this.view.controls.touches.TWO = this.#press === null ? SHIFT : ROTATE;
    if (this.#press !== null) {
      if (this.#press.dragged) event.stopImmediatePropagation(); // a second finger while a part is held
      else this.#yield();
      return;
    }
    if (!event.isPrimary || event.button !== 0 || event === this.#given) return;
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
    this.#press = {
      ...hit,
      at,
      pointer: event.pointerId,
      x: event.clientX,
      y: event.clientY,
      dragged: false,
      denied: false,
      still: event.pointerType === "touch" ? STILL_TOUCH : STILL,
      began: event,
    };
    if (event.pointerType !== "touch") return;
    this.#long = setTimeout(() => {
      this.end();
      this.session.select(hit.robot, hit.node);
      navigator.vibrate?.(10);
    }, LONG);
  }

  /** Two fingers are the view's: it gets the first one now. */
  #yield() {
    const began = this.#press?.began;
    this.end();
    if (began === undefined) return;
    this.#given = new PointerEvent("pointerdown", { ...plain(began), bubbles: true, cancelable: true });
    this.view.canvas.dispatchEvent(this.#given);
  }

  /** @param {PointerEvent} event */
  #move(event) {
    if (this.#press === null) {
      if (event.buttons === 0) this.#point(event);
      return;
    }
    event.stopImmediatePropagation();
    this.#follow(event);
  }

  /** @param {PointerEvent} event */
  #follow(event) {
    const press = this.#press;
    if (press === null || event.pointerId !== press.pointer || press.denied) return;
    if (!press.dragged) {
      if (Math.hypot(event.clientX - press.x, event.clientY - press.y) <= press.still) return;
      const fixed = this.session.isFixed(press.robot, press.node);
      if (fixed) this.emit("fixed", press);
      if (fixed || !this.session.mayAct()) {
        press.denied = true;
        return;
      }
      clearTimeout(this.#long);
      press.dragged = true;
      this.session.send({ type: "start_drag", robot: press.robot, node: press.node, point: press.at.toArray() });
      this.emit("drag", press);
    }
    const met = this.pick.aim(event).intersectPlane(this.#plane, new Vector3());
    if (met !== null) this.target.move(this.view.root.worldToLocal(met).toArray());
  }

  /** @param {PointerEvent} event */
  #release(event) {
    const press = this.#press;
    if (press !== null && event.pointerId === press.pointer) {
      const clicked = event.type === "pointerup" && !press.dragged && !press.denied;
      event.stopImmediatePropagation();
      this.end();
      if (clicked) this.session.select(press.robot, press.node);
      return;
    }
    const beside = this.#beside;
    this.#beside = null;
    if (beside === null || event.type !== "pointerup") return;
    if (Math.hypot(event.clientX - beside.x, event.clientY - beside.y) <= STILL) this.emit("free", event);
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
    const busy = this.#press !== null || this.gizmo.busy;
    if (busy) return;
    const pointer = this.gizmo.hovered ? null : this.#pointer;
    const hit = pointer === null ? null : this.pick.seen(pointer);
    this.view.canvas.style.cursor = this.gizmo.hovered ? "move" : hit === null ? "" : "grab";
    this.emit("point", hit !== null ? null : pointer);
    if (hit?.robot === this.over?.robot && hit?.node === this.over?.node) return;
    this.over = hit;
    this.emit("hover", hit);
  }
}

/** What an event of a pointer is made from. @param {PointerEvent} event */
function plain({ pointerId, pointerType, isPrimary, button, buttons, clientX, clientY }) {
  return { pointerId, pointerType, isPrimary, button, buttons, clientX, clientY };
}
