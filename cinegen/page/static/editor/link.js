// The line of a page with an editor: its session is made anew from every text without errors. The text is in the fragment
// of the page's address: `#raff=...`, and behind it the configuration as soon as the robots were moved and are at rest.

import { cameraOf, fragmentOf, withoutText } from "../../../cockpit/static/base/fragment.js";
import { byId, make } from "../../../cockpit/static/base/dom.js";
import { decode, encode, FragmentError } from "../raff/fragment.js";
import { Link as LocalLink } from "../session/link.js";
import { kernelsOf } from "../session/memory.js";
import { KernelSolver } from "../session/solver.js";
import { helloOf } from "./description.js";
import { Editor } from "./editor.js";
import { GraphicFiles } from "./graphics.js";
import { keep, poseOf } from "./kept_pose.js";
import { KeptWaypoints } from "./kept_waypoints.js";
import { Reader } from "./reading.js";
import { TextScene } from "./scene.js";

const KEY = "raff=";
const RATE = 240; // ticks per second
const QUIET = 200; // ms after a change of the text

/**
 * @typedef {{ text: string, name: string, title: string, worker: string, kernels: string,
 *   graphics: import("./graphics.js").EmbeddedFile[] }} EditedText
 */

export class Link extends LocalLink {
  /** @param {import("../../../cockpit/static/view/view.js").View} view */
  constructor(view) {
    super(view);
    this.files = new GraphicFiles(view.viewer, this.#content.graphics);
    this.scene = new TextScene(view, this.files);
  }

  /** @type {"session" | "page" | "text"} */
  owner = "text";
  /** @type {EditedText} */
  #content = JSON.parse(byId("cinegen-page").textContent ?? "");
  /** @type {import("./reading.js").Model[]} */
  #models = [];
  #waypoints = new KeptWaypoints();
  #timer = 0; // 0: no text waits to be read
  #text = ""; // the present text in the address
  #written = ""; // the fragment of the address
  #unwritten = ""; // why the last text is not in the address
  #wanted = ""; // the fragment of a link, without the text: for the robots of that text

  async connect() {
    const { text, worker, kernels } = this.#content;
    const main = byId("pane").parentElement;
    const section = make("section", { id: "editor", "aria-label": "Editor" });
    main?.prepend(section);
    const module = await import(kernels);
    const reader = new Reader(worker, this.files, (reading) => {
      editor.show(reading.notes);
      document.documentElement.dataset.read = reading.robots.length > 0 ? "yes" : "no";
      if (reading.robots.length > 0) this.#show(module, reading.robots);
      if (this.#timer === 0) this.#follow(reading.robots.length > 0);
    });
    const read = (/** @type {string} */ changed) => {
      document.documentElement.dataset.read = "";
      reader.take(changed, this.#content.name);
    };
    const changed = () => {
      clearTimeout(this.#timer);
      document.documentElement.dataset.read = "";
      this.#timer = window.setTimeout(() => {
        this.#timer = 0;
        const now = editor.text;
        read(now);
        this.#write(now);
      }, QUIET);
    };
    const editor = new Editor(section, text, changed, (why) => this.#warn(why));
    const restore = async () => {
      const { hash } = location;
      if (!hash.startsWith(`#${KEY}`) || hash === this.#written) return false;
      try {
        editor.text = await decode(hash.slice(1 + KEY.length).split("&", 1)[0]);
        this.#wanted = withoutText(hash);
        return true;
      } catch (error) {
        if (!(error instanceof FragmentError)) throw error;
        this.#warn(error.message);
        return false;
      }
    };
    window.addEventListener("hashchange", restore);
    if (await restore()) return;
    read(editor.text);
    await this.#encode(editor.text);
  }

  /**
   * Begin a session with the robots of a text; those of the same structure as before keep their pose, pins and waypoints where
   * it is possible. Settings stay.
   *
   * @param {import("../session/solver_interface").KernelsModule} module
   * @param {import("./reading.js").ReadRobot[]} robots
   */
  #show(module, robots) {
    const before = this.session;
    const poses = poseOf(before, this.#models);
    this.scene.draw(robots);
    this.begin(
      {
        hello: helloOf(this.#content.title, robots), rate: RATE, scene: [],
        robots: robots.map(({ model, tables }) => ({
          name: model.robot, start: Array.from(/** @type {number[]} */ (tables.robot.q)),
          base: { robot: null, node: null, placement: [0, 0, 0, 0, 0, 0, 1] },
        })),
      },
      robots.map(({ tables }) => new KernelSolver(kernelsOf(module, tables))),
    );
    const models = robots.map(({ model }) => model);
    const session = /** @type {import("../session/session.js").LocalSession} */ (this.session);
    keep(poses, session, models);
    if (before !== null) {
      session.obey({ type: "change_settings", ...before.settings });
      session.paused = before.paused;
      const aside = this.#waypoints.pass(before, this.#models, session, models);
      if (aside.length > 0) this.#warn(`The edited robots can't be at ${aside.join(", ")}: waypoints come back when the text lets them.`);
    }
    this.#models = models;
  }

  /**
   * Place the robots and the camera as the link has them whose text was read.
   *
   * @param {boolean} shown whether its text has no errors
   */
  #follow(shown) {
    const wanted = this.#wanted;
    this.#wanted = "";
    if (!shown || wanted.length < 2) return;
    const { camera, problem } = cameraOf(wanted);
    if (problem) this.#warn(problem);
    if (camera !== null) this.scene.view.setCamera(camera);
    this.placeAs(wanted);
  }

  /** @param {string} fragment */
  putAddress(fragment) {
    this.#put(this.#withText(fragment) ?? "#"); // without its text a configuration would be one of another robot
  }

  /**
   * @param {Iterable<[string, ArrayLike<number>]>} configurations by robot
   * @param {import("../../../cockpit/static/base/fragment.js").Camera} camera
   */
  linkTo(configurations, camera) {
    return this.#withText(super.linkTo(configurations, camera) ?? "#");
  }

  /** @param {string} fragment */
  #withText(fragment) {
    return this.#text === "" ? null : `#${this.#text}${fragment.length > 1 ? "&" : ""}${fragment.slice(1)}`;
  }

  /** @param {string} text */
  async #write(text) {
    await this.#encode(text);
    const { camera } = cameraOf(location.hash);
    this.#put(this.#withText(fragmentOf([], camera)) ?? "#"); // else the address would be a link to another text
  }

  /** @param {string} text */
  async #encode(text) {
    try {
      this.#text = KEY + (await encode(text));
      this.#unwritten = "";
    } catch (error) {
      if (!(error instanceof FragmentError)) throw error;
      this.#text = "";
      if (error.message !== this.#unwritten) this.#warn(error.message);
      this.#unwritten = error.message;
    }
  }

  /** @param {string} fragment */
  #put(fragment) {
    this.#written = fragment;
    history.replaceState(null, "", fragment);
  }

  /** @param {string} text */
  #warn(text) {
    this.emit("notice", { text, level: "warning" });
  }
}
