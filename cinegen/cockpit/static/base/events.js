// Who wants to know of something is last.

/** @template {object} [T=Record<string, any>] the value of each event, by its name */
export class Events {
  /** @type {Map<keyof T, ((value: any) => void)[]>} */
  #listeners = new Map();

  /**
   * Call `listener(value)` whenever `name` happens.
   * @template {keyof T} K
   * @param {K} name
   * @param {(value: T[K]) => void} listener
   */
  on(name, listener) {
    this.#listeners.set(name, [...(this.#listeners.get(name) ?? []), listener]);
    return this;
  }

  /**
   * Call all listeners to `name`, in the order in which they were added.
   * @template {keyof T} K
   * @param {K} name
   * @param {T[K]} [value]
   */
  emit(name, value) {
    for (const listener of this.#listeners.get(name) ?? []) {
      try {
        listener(value);
      } catch (error) {
        console.error(`${String(name)}:`, error); // one part of the page that fails stops no other
      }
    }
  }
}
