// The view, rotated and zoomed by steps: for keys.

import { Vector3 } from "three";

const POLE = 0.02; // rad: the view never looks straight along the vertical

/** Rotate the view about what it shows. @param {View} view @param {number} left rad @param {number} up rad */
export function orbit(view, left, up) {
  const { controls } = view;
  const { camera } = view.viewer;
  view.chosen = true;
  const offset = camera.position.clone().sub(controls.target);
  const away = offset.length();
  const azimuth = Math.atan2(offset.x, offset.z) - left;
  const polar = Math.min(Math.max(Math.acos(offset.y / away) - up, POLE), Math.PI - POLE);
  const turned = new Vector3(Math.sin(polar) * Math.sin(azimuth), Math.cos(polar), Math.sin(polar) * Math.cos(azimuth));
  camera.position.copy(controls.target).addScaledVector(turned, away);
  controls.update();
  view.changed();
}

/** Move the view towards what it shows. @param {View} view @param {number} factor of the distance that remains */
export function zoom(view, factor) {
  const { controls } = view;
  const { camera } = view.viewer;
  view.chosen = true;
  camera.position.sub(controls.target).multiplyScalar(factor).add(controls.target);
  controls.update();
  view.changed();
}
