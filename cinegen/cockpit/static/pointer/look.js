// The camera turns to a part: it comes into the middle of the view, from where the camera looks already.

import { Box3, Sphere } from "three";

const NEAREST = 6; // radii of the part

/** @param {View} view @param {Part} part */
export function lookAt(view, { robot, node }) {
  const { controls } = view;
  const { camera } = view.viewer;
  const group = view.group(robot, node);
  const box = new Box3().setFromObject(group);
  const { center, radius } = box.isEmpty() ? new Sphere(group.getWorldPosition(controls.target.clone()), 0) : box.getBoundingSphere(new Sphere());
  const away = camera.position.clone().sub(controls.target);
  if (radius > 0) away.setLength(Math.min(away.length(), NEAREST * radius));
  controls.target.copy(center);
  camera.position.copy(center).add(away);
  controls.update();
  view.chosen = true;
  view.changed();
}
