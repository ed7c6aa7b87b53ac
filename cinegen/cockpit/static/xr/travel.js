// Motion of the world: thumbsticks move, rotate and scale it; a hand that is pressed where no part is takes hold of it,
// and two scale and rotate it between them.

import { Vector3 } from "three";

const SPEED = 0.8; // m/s, at full deflection of a thumbstick
const ROTATION = 1.5; // rad/s
const ZOOM = 1.4; // per second: e-fold growth

export class Travel {
  /** @type {Map<Hand, Vector3>} */
  #holds = new Map(); // hands that hold the world, and where they were in the last frame

  /**
   * @param {{ hands: import("./hands.js").Hands, world: World, handDrags: import("./hand_drags.js").HandDrags }} parts
   */
  constructor({ hands, world, handDrags }) {
    this.hands = hands;
    this.world = world;
    this.handDrags = handDrags;
    handDrags.on("free", (hand) => this.#holds.set(hand, hand.grip.clone()));
    hands.on("release", ({ hand }) => this.#holds.delete(hand));
    hands.on("lose", (hand) => this.#holds.delete(hand));
  }

  /** @param {number} dt s @param {Vector3} toward where the head looks, in the room */
  update(dt, toward) {
    for (const hand of this.hands.all) if (!this.handDrags.has(hand)) this.#steer(hand, dt, toward);
    this.#carry();
  }

  /** @param {Hand} hand @param {number} dt @param {Vector3} toward */
  #steer(hand, dt, toward) {
    const { x, y } = hand.stick;
    if (x === 0 && y === 0) return;
    if (hand.source.handedness === "left") {
      const away = new Vector3(toward.x, 0, toward.z).normalize();
      const right = new Vector3(-away.z, 0, away.x);
      this.world.move(away.multiplyScalar(y * SPEED * dt).addScaledVector(right, x * SPEED * dt));
    } else {
      const pivot = this.world.middle;
      this.world.zoom(Math.exp(ZOOM * y * dt), pivot);
      this.world.rotate(ROTATION * x * dt, pivot);
    }
  }

  #carry() {
    const held = [...this.#holds].filter(([hand]) => hand.tracked).slice(0, 2);
    if (held.length === 1) {
      const [[hand, before]] = held;
      this.world.move(hand.grip.clone().sub(before));
    } else if (held.length === 2) {
      const [[first, firstBefore], [second, secondBefore]] = held;
      const before = secondBefore.clone().sub(firstBefore);
      const now = second.grip.clone().sub(first.grip);
      const middle = first.grip.clone().add(second.grip).multiplyScalar(0.5);
      this.world.move(middle.clone().sub(firstBefore.clone().add(secondBefore).multiplyScalar(0.5)));
      if (before.length() > 1e-3 && now.length() > 1e-3) this.world.zoom(now.length() / before.length(), middle);
      this.world.rotate(Math.atan2(-now.z, now.x) - Math.atan2(-before.z, before.x), middle);
    }
    for (const [hand, before] of held) before.copy(hand.grip);
  }
}
