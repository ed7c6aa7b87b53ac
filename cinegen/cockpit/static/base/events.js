// Who wants to know of something is told.

export class Events {
  #listeners = new Map();

  /** Calls `listener(value)` whenever `name` happens. */
  on(name, listener) {
    if (!this.#listeners.has(name)) this.#listeners.set(name, []);
    this.#listeners.get(name).push(listener);
    return this;
  }

  tell(name, value) {
    for (const listener of this.#listeners.get(name) ?? []) {
      try {
        listener(value);
      } catch (error) {
        console.error(`${name}:`, error); // one part of the page that fails stops no other
      }
    }
  }
}
