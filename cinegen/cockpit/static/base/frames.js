// Frames in which the page draws and ticks: those of its window, or those of a headset while it shows the scene. A
// headset has a rate of its own, and the window's frames may end while it is worn.

export class Frames {
  /** @type {((now: number) => void)[]} */
  #actions = [];
  /** @type {number | null} */
  #next = null; // handle of the window's next frame; null: none is due

  /** Call an action in each frame, with its time (ms). @param {(now: number) => void} action */
  each(action) {
    this.#actions.push(action);
    if (this.#actions.length === 1) this.resume();
  }

  /** Stop the frames of the window: from now on others call `run`. */
  stop() {
    if (this.#next !== null) cancelAnimationFrame(this.#next);
    this.#next = null;
  }

  /** Start the frames of the window. */
  resume() {
    this.#next ??= requestAnimationFrame((now) => {
      this.#next = null;
      this.resume();
      this.run(now);
    });
  }

  /** Run one frame. @param {number} now ms */
  run(now) {
    for (const action of this.#actions) action(now);
  }
}

export const frames = new Frames();
