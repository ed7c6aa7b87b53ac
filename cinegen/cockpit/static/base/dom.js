// Elements made from code. Names of robots and parts are foreign text: they become text, never markup.

const SVG = "http://www.w3.org/2000/svg";

/**
 * An element: `make("button", { class: "small", title: "...", on: { click } }, "text", child)`.
 * `data` sets data attributes, `on` listens, true and false set or leave out an attribute.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, any>} attributes
 * @param {...(Node | string | null | undefined)} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "on") {
      for (const [event, listener] of Object.entries(value)) element.addEventListener(event, listener);
    } else if (name === "data") Object.assign(element.dataset, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/**
 * A button, which calls `click`.
 * @param {Record<string, any>} attributes
 * @param {() => unknown} click
 * @param {...(Node | string)} children
 */
export function button(attributes, click, ...children) {
  return make("button", { type: "button", ...attributes, on: { click } }, ...children);
}

/** Return whether a button that is a switch is on. @param {Element} button */
export function isOn(button) {
  return button.getAttribute("aria-pressed") === "true";
}

/** Show a switch as on or off. @param {Element} button @param {boolean} on */
export function press(button, on) {
  if (button.getAttribute("aria-pressed") !== String(on)) button.setAttribute("aria-pressed", String(on));
}

/** Show another sign in an element. @param {Element} element @param {string} name */
export function show(element, name) {
  element.querySelector("use")?.setAttribute("href", `#sign-${name}`);
}

/**
 * A list of values to choose from, each with its text.
 * @param {Record<string, any>} attributes
 * @param {Iterable<[string | number, string]>} options
 */
export function choice(attributes, options) {
  return make("select", { class: "small", ...attributes }, ...[...options].map(([value, text]) => make("option", { value }, text)));
}

/**
 * Take away the elements of what is no more.
 * @template K
 * @param {Map<K, { element: Element }>} shown
 * @param {K[]} keys of what stays
 */
export function keepOnly(shown, keys) {
  for (const [key, { element }] of shown) if (!keys.includes(key) && shown.delete(key)) element.remove();
}

/** One of the signs of the page's sheet (see index.html). @param {string} name */
export function sign(name) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("class", "sign");
  svg.setAttribute("aria-hidden", "true");
  const use = document.createElementNS(SVG, "use");
  use.setAttribute("href", `#sign-${name}`);
  svg.append(use);
  return svg;
}

/**
 * Sets a text where it is another: an untouched element is not laid out anew.
 * @param {Element} element
 * @param {string} text
 */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/**
 * Return the element of index.html with an id.
 * @template {HTMLElement} [T=HTMLElement]
 * @param {string} id
 * @returns {T}
 */
export function byId(id) {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`index.html has no element with the id "${id}"`);
  return /** @type {T} */ (element);
}

/** What was chosen in this browser before; a browser may refuse to keep it. */
export const memory = {
  /**
   * @template T
   * @param {string} name
   * @param {T} otherwise what is returned where nothing of this type is kept
   * @returns {T}
   */
  get(name, otherwise) {
    try {
      const kept = JSON.parse(localStorage.getItem(`cinegen.${name}`) ?? "null");
      return kept === null || typeof kept !== typeof otherwise ? otherwise : kept;
    } catch {
      return otherwise;
    }
  },
  /** @param {string} name @param {unknown} value */
  set(name, value) {
    try {
      localStorage.setItem(`cinegen.${name}`, JSON.stringify(value));
    } catch {
      // it is forgotten
    }
  },
};

/**
 * Calls `action` at once, then at most once in `milliseconds`, with the newest value last.
 * @template [T=void]
 * @param {number} milliseconds
 * @param {(value: T) => void} action
 */
export function atMostEvery(milliseconds, action) {
  let last = -Infinity;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  /** @type {T} */
  let newest;
  const run = () => {
    timer = undefined;
    last = performance.now();
    action(newest);
  };
  /** @param {T} value */
  const offer = (value) => {
    newest = value;
    if (timer !== undefined) return;
    const wait = last + milliseconds - performance.now();
    if (wait <= 0) run();
    else timer = setTimeout(run, wait);
  };
  /** Does now what waits. */
  offer.flush = () => {
    if (timer === undefined) return;
    clearTimeout(timer);
    run();
  };
  /** Forgets what waits. */
  offer.stop = () => {
    clearTimeout(timer);
    timer = undefined;
  };
  return offer;
}
