// A gamepad of this browser as a sensor: sent while it is deflected, and once when it comes to rest. It is read only
// while a node follows it.
//
// Left stick: right and away. Right trigger up, left trigger down. Right stick tilts, shoulder buttons turn about z.

const DEAD = 0.05;
const OFTEN = 1000 / 30; // ms

export class Gamepad {
  #moving = false;
  /** @type {ReturnType<typeof setInterval> | undefined} */
  #timer;

  /** @param {Session} session */
  constructor(session) {
    this.session = session;
    session.on("report", (report) => this.#watch(report));
    for (const name of /** @type {const} */ (["lost", "dropped"])) session.on(name, () => this.#stop());
  }

  /** @param {SessionReport} report */
  #watch({ switches = [] }) {
    /** @type {Set<string | null>} */
    const mine = new Set(
      (this.session.hello?.sensors ?? []).filter(({ id, url }) => id === "gamepad" || url?.startsWith("gamepad:"))
        .map(({ id }) => id),
    );
    const wanted = switches.some(({ sensor }) => mine.has(sensor)) && this.session.control !== "other";
    if (wanted && this.#timer === undefined) this.#timer = setInterval(() => this.#read(), OFTEN);
    else if (!wanted) this.#stop();
  }

  #stop() {
    clearInterval(this.#timer);
    this.#timer = undefined;
    this.#moving = false;
  }

  #read() {
    const pad = [...(navigator.getGamepads?.() ?? [])].find((gamepad) => gamepad?.connected) ?? null;
    /** @type {[number, number, number, number, number, number]} */
    const twist = pad === null ? [0, 0, 0, 0, 0, 0] : twistOf(pad);
    const buttons = pad === null ? [] : pad.buttons.flatMap((button, i) => (button.pressed ? [i] : []));
    const moving = twist.some((value) => value !== 0) || buttons.length > 0;
    if (moving || this.#moving) this.session.send({ type: "gamepad_input", twist, buttons });
    this.#moving = moving;
  }
}

/**
 * Return the twist of a gamepad's deflection: x right, y away, z up, then about them; -1 to 1.
 * @param {Pick<globalThis.Gamepad, "axes"> & { buttons: readonly { value: number }[] }} pad
 */
export function twistOf({ axes, buttons }) {
  /** @param {number} i */
  const axis = (i) => rest(axes[i] ?? 0);
  /** @param {number} i */
  const button = (i) => buttons[i]?.value ?? 0;
  return /** @type {[number, number, number, number, number, number]} */ ([axis(0), -axis(1), rest(button(7) - button(6)), axis(3), axis(2), rest(button(4) - button(5))].map((value) =>
    value === 0 ? 0 : Number(value.toFixed(3)),
  ));
}

/**
 * Return a deflection, -1 to 1: nothing within the dead zone, and from there on from 0 to 1.
 * @param {number} value
 * @param {number} dead
 */
export function rest(value, dead = DEAD) {
  const size = Math.min(1, Math.abs(value));
  return size <= dead ? 0 : (Math.sign(value) * (size - dead)) / (1 - dead);
}
