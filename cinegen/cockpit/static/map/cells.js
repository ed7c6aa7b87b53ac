// The cells of a map as they are drawn: balls in space, or tiles where they make a surface; in one draw call.

import {
  BufferAttribute, BufferGeometry, DoubleSide, Float32BufferAttribute, Group, Mesh, MeshBasicMaterial, Points,
  ShaderMaterial, Vector3,
} from "three";
import { colour } from "./colours.js";

const MOST_PIXELS = 240; // of a ball
const VERTEX = `
  attribute vec3 color;
  uniform float size;
  uniform float high;
  varying vec3 cellColor;
  void main() {
    cellColor = color;
    vec4 seen = modelViewMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * seen;
    gl_PointSize = clamp(size * projectionMatrix[1][1] * 0.5 * high / gl_Position.w, 1.5, ${MOST_PIXELS}.0);
  }`;
const FRAGMENT = `
  varying vec3 cellColor;
  void main() {
    vec2 at = 2.0 * gl_PointCoord - 1.0;
    float away = dot(at, at);
    if (away > 1.0) discard;
    float light = 0.62 + 0.38 * max(0.0, dot(vec3(at.x, -at.y, sqrt(1.0 - away)), vec3(-0.35, 0.45, 0.82)));
    gl_FragColor = vec4(cellColor * light, 1.0);
  }`;
const CORNERS = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];

/**
 * @typedef {Points<BufferGeometry, ShaderMaterial> | Mesh<BufferGeometry, MeshBasicMaterial>} Drawn
 * @typedef {{ cell: number, away: number }} Met
 */

export class Cells {
  #group = new Group();
  /** @type {Drawn | null} */
  #drawn = null;
  #where = new Vector3();
  #along = new Vector3();

  /** @param {{ view: View, field: Field }} parts */
  constructor({ view, field }) {
    this.view = view;
    this.field = field;
    this.#group.matrixAutoUpdate = false;
    view.stage.add(this.#group);
    field.on("cells", () => this.#draw());
    field.on("change", () => this.#draw());
    view.before(() => this.#place());
  }

  /** The middle of a cell, in the world. @param {number} cell */
  middle(cell, into = new Vector3()) {
    const points = this.field.array("points");
    return into.fromArray(points, 3 * cell).applyMatrix4(this.#group.matrix);
  }

  /**
   * The cell that a ray of the scene meets first, and how far away; null if none.
   * @param {import("three").Ray} ray
   * @returns {Met | null}
   */
  met(ray) {
    const { field } = this;
    if (field.about === null || field.seen.length === 0) return null;
    this.#group.updateWorldMatrix(true, false);
    const scale = this.#group.matrixWorld.getMaxScaleOnAxis();
    const back = this.#group.matrixWorld.clone().invert();
    const from = this.#where.copy(ray.origin).applyMatrix4(back);
    const along = this.#along.copy(ray.direction).transformDirection(back);
    const hit = field.about.surface ? this.#tile(from, along) : this.#ball(from, along, 0.5 * this.#size(field.about));
    return hit === null ? null : { cell: hit.cell, away: hit.away * scale };
  }

  /** @param {Vector3} from @param {Vector3} along @param {number} radius */
  #ball(from, along, radius) {
    const { field } = this;
    const points = field.array("points");
    /** @type {Met | null} */
    let best = null;
    for (const cell of field.seen) {
      const x = points[3 * cell] - from.x;
      const y = points[3 * cell + 1] - from.y;
      const z = points[3 * cell + 2] - from.z;
      const away = x * along.x + y * along.y + z * along.z;
      if (away <= 0 || (best !== null && away >= best.away)) continue;
      if (x * x + y * y + z * z - away * away <= radius ** 2) best = { cell, away };
    }
    return best;
  }

  /** @param {Vector3} from @param {Vector3} along */
  #tile(from, along) {
    const { field } = this;
    const points = field.array("points");
    const edges = field.array("edges");
    const [middle, side, other, normal, at] = Array.from({ length: 5 }, () => new Vector3());
    const half = 0.5 * field.share;
    /** @type {Met | null} */
    let best = null;
    for (const cell of field.seen) {
      middle.fromArray(points, 3 * cell).sub(from);
      const near = middle.dot(along);
      side.fromArray(edges, 6 * cell);
      other.fromArray(edges, 6 * cell + 3);
      if (middle.lengthSq() - near * near > side.lengthSq() + other.lengthSq()) continue;
      normal.crossVectors(side, other);
      const away = normal.dot(middle) / normal.dot(along);
      if (!(away > 0) || (best !== null && away >= best.away)) continue;
      at.copy(along).multiplyScalar(away).sub(middle);
      const [u, v] = [solve(at, side, other), solve(at, other, side)];
      if (Math.abs(u) <= half && Math.abs(v) <= half) best = { cell, away };
    }
    return best;
  }

  /** @param {import("./field.js").About} about */
  #size(about) {
    return this.field.share * about.size;
  }

  /** The robot's world is the map's. */
  #place() {
    const { about } = this.field;
    if (about === null || this.#drawn === null) return;
    const robot = this.view.group(about.robot);
    this.#group.matrix.compose(robot.position, robot.quaternion, robot.scale);
    this.#group.matrixWorldNeedsUpdate = true;
    const { material } = this.#drawn;
    if (!(material instanceof ShaderMaterial)) return;
    const { uniforms } = material;
    uniforms.high.value = this.view.canvas.height;
    uniforms.size.value = this.#size(about) * this.view.stage.matrix.getMaxScaleOnAxis();
  }

  #draw() {
    if (this.#drawn !== null) {
      this.#group.remove(this.#drawn);
      this.#drawn.geometry.dispose();
      this.#drawn.material.dispose();
    }
    this.#drawn = this.field.about?.surface ? this.#tiles() : this.#balls();
    this.#drawn.frustumCulled = false;
    this.#group.add(this.#drawn);
    this.view.changed();
  }

  /** The colours of all cells that are seen, of each so many times. @param {number} each */
  #colours(each) {
    const { field } = this;
    const { seen } = field;
    const values = field.values();
    const { low = 0, high = 1 } = field.description() ?? {};
    const range = high > low ? high - low : 1;
    const colours = new Float32Array(3 * each * seen.length);
    for (let i = 0; i < seen.length; i += 1) {
      const part = values === null ? 0.5 : (values[seen[i]] - low) / range;
      for (let k = 0; k < each; k += 1) colour(part, colours, 3 * (each * i + k));
    }
    return colours;
  }

  #balls() {
    const { seen } = this.field;
    const points = this.field.array("points");
    const positions = new Float32Array(3 * seen.length);
    seen.forEach((cell, i) => positions.set(points.subarray(3 * cell, 3 * cell + 3), 3 * i));
    const material = new ShaderMaterial({
      uniforms: { size: { value: 0 }, high: { value: 1 } },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
    });
    return new Points(geometry(positions, this.#colours(1)), material);
  }

  #tiles() {
    const { seen, share } = this.field;
    const points = this.field.array("points");
    const edges = this.field.array("edges");
    const positions = new Float32Array(12 * seen.length);
    const triangles = new Uint32Array(6 * seen.length);
    seen.forEach((cell, i) => {
      CORNERS.forEach(([u, v], k) => {
        for (let x = 0; x < 3; x += 1) {
          const across = u * edges[6 * cell + x] + v * edges[6 * cell + 3 + x];
          positions[12 * i + 3 * k + x] = points[3 * cell + x] + share * across;
        }
      });
      triangles.set([0, 1, 2, 0, 2, 3].map((k) => 4 * i + k), 6 * i);
    });
    const tiles = geometry(positions, this.#colours(4));
    tiles.setIndex(new BufferAttribute(triangles, 1));
    const material = new MeshBasicMaterial({ vertexColors: true, side: DoubleSide, transparent: true, opacity: 0.85 });
    return new Mesh(tiles, material);
  }
}

/**
 * How far along `one` a vector in the plane of two goes.
 * @param {Vector3} at
 * @param {Vector3} side
 * @param {Vector3} other
 */
function solve(at, side, other) {
  const [aa, ab, bb] = [side.dot(side), side.dot(other), other.dot(other)];
  return (at.dot(side) * bb - at.dot(other) * ab) / (aa * bb - ab * ab);
}

/** @param {Float32Array} positions @param {Float32Array} colours */
function geometry(positions, colours) {
  const made = new BufferGeometry();
  made.setAttribute("position", new Float32BufferAttribute(positions, 3));
  made.setAttribute("color", new Float32BufferAttribute(colours, 3));
  return made;
}
