// What is seen: meshcat's viewer, the robots moved as states come, and a stage for what the page itself draws.
//
// meshcat's scene is turned (z up -> y up), and the group "cinegen" scales and shifts the robots into the view. Below
// that group everything is in the robots' metres, z up: "world" here. `stage` is an object whose own coordinates are
// the same world, outside of the tree that the server draws; `level` is one that is not turned at all.

import { Box3, Group, Mesh, Object3D, Quaternion, Vector3, WebGLRenderer } from "three";
import { frames } from "../base/frames.js";
import { nameOf, segment, valueOf } from "../base/names.js";
import { keyOf } from "../base/session.js";
import { Pyramid } from "./framing.js";
import { dress } from "./material.js";
import { Resolution } from "./resolution.js";

const ROOT = ["meshcat", "cinegen"];
const POSE = 7;
const LAST = "bottom_color"; // property that the server's scene ends with
const FILLED = 0.7; // share of the view that robots fill
const REACHED = 0.95; // share in which they stay
const ROOMY = 0.85; // share that they fill where the camera moves once
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i; // renderers without a graphics card
const MARKS = /^(triad$|loop )/; // names of what the server draws on parts, which is no part

export class View {
  /** @type {Map<string, import("three").Object3D>} */
  #groups = new Map(); // of robots and nodes, as found in the tree
  /** @type {((drawn: boolean) => void)[]} */
  #before = [];
  /** @type {((drawn: boolean) => void)[]} */
  #last = [];
  /** @type {Map<string, import("three").BufferGeometry>} */
  #geometries = new Map(); // of the scene, by what the server calls them
  #heard = 0;
  #seen = false; // whether a picture was drawn since it was framed
  /** @type {Pyramid[]} */
  #kept = []; // around all that was in the view since it was framed; the last is the next view
  /** @type {Map<string, { robot: KnownRobot, numbers: number[] }>} */
  #applied = new Map(); // by robot: itself, and its poses as they were last applied

  /** @type {((box: Box3) => void) | null} */
  also = null; // (box of the scene) => void: what else than robots fills the view
  /** @type {Set<string>} */
  background = new Set(); // names of what can't be moved: neither framed nor picked
  whole = false; // whether everything that the scene has is there: nothing is drawn before
  chosen = false; // whether the camera was set, by a person or as a link has it
  framed = false; // whether the view is framed again when its size changes, unless the camera was set
  free = () => ({ left: 0, top: 0, right: this.pane.clientWidth, bottom: this.pane.clientHeight }); // pixels nothing covers
  /** @type {import("three").PerspectiveCamera | null} */
  headset = null; // camera of a headset that shows the scene instead of the pane

  /** @param {HTMLElement} pane @param {{ still?: boolean }} options */
  constructor(pane, { still = false } = {}) {
    this.pane = pane;
    const viewer = new window.MeshCat.Viewer(pane, false, still ? undefined : drawer(pane));
    this.viewer = viewer;
    viewer.gui.domElement.remove(); // its controls would cover the panel
    viewer.scene_tree.folder = noFolder(); // making them would take most of the time in which a scene is drawn
    this.canvas = viewer.renderer.domElement;
    const resize = window.MeshCat.Viewer.prototype.set_3d_pane_size;
    viewer.set_3d_pane_size = () => {
      if (this.headset === null) resize.call(viewer, Math.max(1, pane.clientWidth), Math.max(1, pane.clientHeight));
    };
    new ResizeObserver(() => this.fit()).observe(pane);
    viewer.controls.addEventListener("start", () => (this.chosen = true));
    this.#listen();
    this.level = new Object3D();
    this.level.quaternion.copy(viewer.scene.quaternion).invert();
    this.stage = new Group();
    this.stage.matrixAutoUpdate = false;
    this.level.add(this.stage);
    viewer.scene.add(this.level);
    this.resolution = new Resolution(viewer, still);
    frames.each((now) => this.#draw(now));
  }

  get root() {
    return this.viewer.scene_tree.find(ROOT).object;
  }

  get camera() {
    return this.headset ?? this.viewer.camera;
  }

  get controls() {
    return this.viewer.controls;
  }

  /** Something has changed: the next picture is drawn. */
  changed() {
    this.viewer.set_dirty();
  }

  /**
   * Calls `action` before every picture; with true when the server has drawn something since the last.
   * @param {(drawn: boolean) => void} action
   */
  before(action) {
    this.#before.push(action);
  }

  /** The same, after all of `before`. @param {(drawn: boolean) => void} action */
  last(action) {
    this.#last.push(action);
  }

  /**
   * Listen to the server's commands: a scene is whole when the last of its properties came, which come last; once it is
   * framed, what it says of cameras is left out.
   */
  #listen() {
    const { viewer } = this;
    const handle = viewer.handle_command.bind(viewer);
    const put = viewer.set_object.bind(viewer);
    viewer.set_object = (path, object) => {
      this.#share(object);
      dress(object);
      put(path, object);
    };
    viewer.handle_command = (command) => {
      if (this.framed && command.path?.startsWith("/Cameras")) return;
      if (command.type === "delete" && command.path === `/${ROOT.join("/")}`) {
        this.whole = false;
        this.#geometries.clear();
      }
      handle(command);
      this.whole ||= command.property === LAST;
    };
  }

  /** Give an object its geometry, which the server sends with the first object that has it. @param {Object3D} object */
  #share(object) {
    const shape = /** @type {Mesh} */ (object);
    if (shape.geometry === undefined) return;
    const { uuid, attributes } = shape.geometry;
    if (attributes.position === undefined) shape.geometry = this.#geometries.get(uuid) ?? shape.geometry;
    else this.#geometries.set(uuid, shape.geometry);
  }

  /** What was drawn is forgotten: the server draws its scene anew. */
  clear() {
    if (this.viewer.scene_tree.children[ROOT[0]] !== undefined) this.viewer.delete_path([ROOT[0]]);
    this.whole = false;
    this.#geometries.clear();
    this.forget();
  }

  /** Carry out a drawing command of meshcat. @param {Uint8Array} command */
  handle(command) {
    this.viewer.handle_command_message({ data: command });
  }

  /** The group of a robot or of one of its nodes. @param {string} robot @param {string | null} node */
  group(robot, node = null) {
    const key = node === null ? robot : keyOf(robot, node);
    let group = this.#groups.get(key);
    if (group === undefined || group.parent === null) {
      group = this.viewer.scene_tree.find([...ROOT, segment(robot), ...(node === null ? [] : [segment(node)])]).object;
      this.#groups.set(key, group);
    }
    return group;
  }

  /** Move robots, or obstacles, to where a state has them. @param {KnownRobot[]} robots @param {Record<string, number[]> | undefined} poses */
  apply(robots, poses) {
    for (const robot of robots) {
      const numbers = valueOf(poses, robot.name);
      if (!Array.isArray(numbers) || numbers.length < POSE * (robot.obstacle ? 1 : 1 + robot.nodes.length)) continue;
      const before = this.#applied.get(robot.name)?.numbers;
      if (before !== undefined && before.every((value, i) => value === numbers[i])) continue;
      this.#applied.set(robot.name, { robot, numbers });
      this.#place(robot, numbers);
    }
  }

  /** Robots are forgotten: others may be drawn in their place. */
  forget() {
    this.#applied.clear();
    this.#groups.clear();
  }

  /** Find the groups of all parts again, which may have been drawn anew, and move them. */
  #find() {
    this.#groups.clear();
    for (const { robot, numbers } of this.#applied.values()) this.#place(robot, numbers);
  }

  /** @param {KnownRobot} robot @param {number[]} numbers */
  #place(robot, numbers) {
    put(this.group(robot.name), numbers, 0);
    if (!robot.obstacle) robot.nodes.forEach((node, i) => put(this.group(robot.name, node.name), numbers, POSE * (i + 1)));
    this.changed();
  }

  /**
   * Where a node is in the world, by the last state.
   * @param {string} robot
   * @param {string} node
   * @param {Vector3} position
   * @param {Quaternion} quaternion
   */
  pose(robot, node, position = new Vector3(), quaternion = new Quaternion()) {
    const base = this.group(robot);
    const part = this.group(robot, node);
    position.copy(part.position).applyQuaternion(base.quaternion).add(base.position);
    quaternion.copy(base.quaternion).multiply(part.quaternion);
    return { position, quaternion };
  }

  /** How the camera stands in the world: x right, y up, z towards the viewer. */
  cameraOrientation(quaternion = new Quaternion()) {
    const turned = this.root.getWorldQuaternion(new Quaternion()).invert();
    return quaternion.copy(turned).multiply(this.camera.getWorldQuaternion(new Quaternion()));
  }

  /**
   * Return the position of the camera and the point in its middle, in the world, m.
   * @returns {import("../base/fragment.js").Camera}
   */
  cameraNumbers() {
    const { root } = this;
    root.updateWorldMatrix(true, false);
    const [position, middle] = [this.viewer.camera.position, this.controls.target].map((point) => root.worldToLocal(point.clone()));
    return [position.x, position.y, position.z, middle.x, middle.y, middle.z];
  }

  /** Set the camera, by numbers as `cameraNumbers` returns them. @param {import("../base/fragment.js").Camera} camera */
  setCamera([x, y, z, ...middle]) {
    const { root } = this;
    root.updateWorldMatrix(true, false);
    this.chosen = true;
    this.viewer.camera.position.copy(root.localToWorld(new Vector3(x, y, z)));
    this.controls.target.copy(root.localToWorld(new Vector3(...middle)));
    this.controls.update();
    this.changed();
  }

  /** A point of the world in pixels of the pane; null behind the camera. @param {Vector3} point @param {Vector3} where */
  pixels(point, where = new Vector3()) {
    where.copy(point).applyMatrix4(this.stage.matrix);
    const behind = where.clone().applyMatrix4(this.camera.matrixWorldInverse).z > 0;
    where.project(this.camera);
    where.x = ((where.x + 1) / 2) * this.pane.clientWidth;
    where.y = ((1 - where.y) / 2) * this.pane.clientHeight;
    return behind ? null : where;
  }

  /** Expand a box (three's own axes) by all that can be moved. @param {Box3} box */
  bounds(box) {
    this.root.updateWorldMatrix(true, true);
    for (const robot of this.root.children) {
      if (this.background.has(nameOf(robot.name))) continue;
      robot.traverse((object) => {
        if (object instanceof Mesh) box.expandByObject(object);
      });
    }
    return box;
  }

  /** Take the size of the pane; robots fill it again, unless the camera was set. */
  fit() {
    this.viewer.set_3d_pane_size();
    if (this.framed && !this.chosen && this.headset === null) this.frame();
  }

  /** Move the camera, but don't turn it, so that robots fill their share of the view. */
  frame() {
    this.chosen = false;
    this.#kept = [];
    this.#move(this.#around(this.#pyramid(FILLED)));
  }

  /**
   * Move the camera, but don't turn it, if robots leave the view: all that was there since `frame` fits into it, just, or with room
   * for more, so that it moves once and not again and again.
   * @param {boolean} once
   */
  keep(once) {
    this.#kept = [REACHED, ...(once ? [ROOMY] : [])].map((share, i) => this.#around(this.#kept[i] ?? this.#pyramid(share)));
    if (!this.#kept[0].isWithin(this.viewer.camera.position)) this.#move(this.#kept[this.#kept.length - 1]);
  }

  /** @param {number} share of the view that is free */
  #pyramid(share) {
    this.controls.update(); // the server may have moved the camera since
    const { clientWidth: wide, clientHeight: high } = this.pane;
    const { left, right, top, bottom } = this.free();
    const [x, y] = [(left + right) / wide - 1, 1 - (top + bottom) / high];
    const [across, up] = [(share * (right - left)) / wide, (share * (bottom - top)) / high];
    return new Pyramid(this.viewer.camera, { left: x - across, right: x + across, bottom: y - up, top: y + up });
  }

  /** Expand a pyramid by everything that fills the view. @param {Pyramid} pyramid */
  #around(pyramid) {
    this.root.updateWorldMatrix(true, true);
    for (const robot of this.root.children) {
      if (this.background.has(nameOf(robot.name))) continue;
      for (const part of robot.children.flatMap((node) => node.children)) if (!MARKS.test(part.name)) pyramid.add(part);
    }
    const box = new Box3();
    this.also?.(box);
    if (!box.isEmpty()) pyramid.addBox(box);
    return pyramid;
  }

  /** @param {Pyramid} pyramid */
  #move(pyramid) {
    if (pyramid.empty) return;
    const { position, middle } = pyramid.place();
    this.viewer.camera.position.copy(position); // meshcat turns the camera's group back: it lives in three's own axes
    this.controls.target.copy(middle);
    this.controls.update();
    this.changed();
  }

  /** The picture as it is now, as a PNG's address. */
  picture() {
    this.resolution.choose(false);
    this.#prepare(false);
    this.viewer.render();
    return this.canvas.toDataURL("image/png");
  }

  /** @param {boolean} drawn */
  #prepare(drawn) {
    const root = this.root;
    root.updateWorldMatrix(true, false);
    this.level.updateWorldMatrix(true, false);
    this.stage.matrixWorld.copy(root.matrixWorld);
    this.stage.matrix.copy(this.level.matrixWorld).invert().multiply(root.matrixWorld);
    this.stage.matrixWorldNeedsUpdate = true;
    this.stage.visible = this.whole;
    this.camera.updateWorldMatrix(true, false);
    this.viewer.camera.updateProjectionMatrix(); // meshcat does so when it renders: after its zoom came, labels would be elsewhere
    for (const action of [...this.#before, ...this.#last]) action(drawn);
  }

  /** Whether the server has drawn something since the last call. */
  #hear() {
    const drawn = this.viewer.num_messages_received !== this.#heard;
    this.#heard = this.viewer.num_messages_received;
    return drawn;
  }

  /** Draw a picture for the headset. */
  drawForHeadset() {
    if (this.headset === null) return;
    const drawn = this.#hear();
    if (drawn) this.#find();
    this.#prepare(drawn);
    this.viewer.renderer.render(this.viewer.scene, this.headset);
  }

  /** @param {number} now */
  #draw(now) {
    if (this.headset !== null || !this.whole) return;
    const drawn = this.#hear();
    const due = drawn || this.viewer.needs_render;
    const moving = due && this.#seen; // the first picture is complete
    if (!due && !this.resolution.due(now)) {
      this.resolution.idle();
      return;
    }
    if (drawn) this.#find(); // whatever the scene says of where parts are
    this.resolution.choose(moving);
    this.#prepare(drawn);
    this.viewer.render();
    this.resolution.drew(now, moving);
    this.#seen ||= this.framed;
  }
}

/**
 * Position and turn from seven numbers.
 * @param {import("three").Object3D} object
 * @param {number[]} numbers
 * @param {number} at
 */
function put(object, numbers, at) {
  object.position.set(numbers[at], numbers[at + 1], numbers[at + 2]);
  object.quaternion.set(numbers[at + 3], numbers[at + 4], numbers[at + 5], numbers[at + 6]);
}

/**
 * What meshcat's viewer takes for a folder of controls, without any.
 * @returns {View["viewer"]["scene_tree"]["folder"]}
 */
function noFolder() {
  const none = () => control;
  const control = { min: none, max: none, step: none, onChange: none, updateDisplay: none };
  return { domElement: document.createElement("div"), __folders: {}, addFolder: noFolder, add: none, remove: none, removeFolder: none };
}

/**
 * A renderer as meshcat makes it, but without smooth edges where there is no graphics card: they cost most there.
 * @param {HTMLElement} pane
 */
function drawer(pane) {
  const probe = document.createElement("canvas").getContext("webgl", { failIfMajorPerformanceCaveat: true });
  const names = probe?.getExtension("WEBGL_debug_renderer_info");
  const name = probe?.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : probe.RENDERER) ?? "";
  const antialias = probe !== null && !SOFTWARE.test(name);
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  const renderer = new WebGLRenderer({ antialias, alpha: true }); // a headset may show the room behind the scene
  pane.append(renderer.domElement);
  return renderer;
}
