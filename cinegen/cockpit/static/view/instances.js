// Parts of one geometry and one look are drawn at once, each where it is; those that are lit up, see-through or mirrored, alone.

import { InstancedMesh } from "three";
import { dress } from "./material.js";

export const TOGETHER = 3; // layer of parts that are drawn with others: pointers meet them, cameras don't

/** @typedef {import("three").Mesh<import("three").BufferGeometry, any>} Mesh */

export class Instances {
  /** @type {{ all: InstancedMesh<any, any>, parts: Mesh[] }[]} */
  #sets = [];

  /** @param {View} view */
  constructor(view) {
    this.view = view;
    view.last((drawn) => {
      view.root.updateWorldMatrix(true, true);
      if (drawn) this.#gather();
      for (const { all, parts } of this.#sets) this.#place(all, parts);
    });
  }

  #gather() {
    for (const { all } of this.#sets) {
      all.removeFromParent();
      for (const look of Object.values(all.userData.made)) look.dispose();
      all.dispose();
    }
    /** @type {Map<string, Mesh[]>} */
    const alike = new Map();
    this.view.root.traverse((object) => {
      const part = /** @type {Mesh} */ (object);
      const { matt } = part.userData.made ?? { matt: { transparent: true } };
      part.layers.set(0);
      if (matt.transparent || part.matrixWorld.determinant() < 0) return;
      const key = [part.geometry.uuid, matt.color.getHex(), matt.map?.uuid, matt.vertexColors].join();
      if (!alike.get(key)?.push(part)) alike.set(key, [part]);
    });
    this.#sets = [...alike.values()].filter(({ length }) => length > 1).map((parts) => {
      const all = new InstancedMesh(parts[0].geometry, parts[0].userData.made.matt.clone(), parts.length);
      dress(all);
      Object.assign(all, { castShadow: true, receiveShadow: true, frustumCulled: false, matrixAutoUpdate: false });
      all.material.emissive.setHex(0);
      this.view.viewer.scene.add(all);
      return { all, parts };
    });
  }

  /** @param {InstancedMesh<any, any>} all @param {Mesh[]} parts */
  #place(all, parts) {
    all.count = 0;
    for (const part of parts) {
      const alone = part.userData.made.matt.emissive.getHex() !== 0;
      part.layers.set(alone ? 0 : TOGETHER);
      if (!alone && isSeen(part)) all.setMatrixAt(all.count++, part.matrixWorld);
    }
    all.instanceMatrix.needsUpdate = true;
    all.material = all.userData.made[this.view.resolution.complete ? "paint" : "matt"];
    all.matrix.copy(this.view.viewer.scene.matrixWorld).invert();
    all.matrixWorldNeedsUpdate = true;
  }
}

/** @param {import("three").Object3D | null} object @returns {boolean} */
function isSeen(object) {
  return object === null || (object.visible && isSeen(object.parent));
}
