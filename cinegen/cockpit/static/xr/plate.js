// A plate in the scene with a drawing on it, which faces a head.

import { CanvasTexture, DoubleSide, Mesh, MeshBasicMaterial, PlaneGeometry } from "three";

export const FONT = "system-ui, sans-serif";

export class Plate {
  /** @param {number} width pixels @param {number} height pixels */
  constructor(width, height) {
    this.canvas = document.createElement("canvas");
    Object.assign(this.canvas, { width, height });
    this.context = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    this.texture = new CanvasTexture(this.canvas);
    const material = new MeshBasicMaterial({ map: this.texture, transparent: true, depthTest: false, side: DoubleSide });
    this.mesh = new Mesh(new PlaneGeometry(1, 1), material);
    this.mesh.renderOrder = 20;
  }

  /** Draw it anew. @param {(context: CanvasRenderingContext2D) => void} draw */
  draw(draw) {
    this.context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    draw(this.context);
    this.texture.needsUpdate = true;
  }

  /**
   * Place it, facing a head.
   * @param {import("three").Vector3} at
   * @param {import("three").Vector3} head
   * @param {number} width m
   */
  place(at, head, width) {
    this.mesh.position.copy(at);
    this.mesh.scale.set(width, (width * this.canvas.height) / this.canvas.width, 1);
    // lookAt turns it away where a parent is scaled: in the room none is
    this.mesh.quaternion.setFromRotationMatrix(this.mesh.matrix.lookAt(head, at, this.mesh.up));
  }

  /** Free what the graphics card holds. */
  dispose() {
    this.texture.dispose();
    this.mesh.geometry.dispose();
    /** @type {MeshBasicMaterial} */ (this.mesh.material).dispose();
  }
}
