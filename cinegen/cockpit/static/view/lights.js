// The lights of the scene, in place of meshcat's: a bright sky, and a lamp to the left of the first view, so that faces of
// different directions differ.

import { DirectionalLight, HemisphereLight } from "three";

/** @param {import("./view.js").View} view */
export function light({ viewer }) {
  for (const name of ["SpotLight", "PointLightNegativeX", "PointLightPositiveX", "AmbientLight"]) viewer.delete_path(["Lights", name]);
  const lamp = new DirectionalLight(0xfff4e6, 0.5);
  lamp.position.set(2, -3, 4);
  const back = new DirectionalLight(0xdfe9ff, 0.22);
  back.position.set(-3, 2, 1);
  const sky = new HemisphereLight(0xffffff, 0x8c9299, 0.75);
  sky.position.set(0, 0, 1); // z is up
  viewer.set_object(["Lights", "Lamp"], lamp);
  viewer.set_object(["Lights", "FillLight"], back);
  viewer.set_object(["Lights", "Sky"], sky);
}
