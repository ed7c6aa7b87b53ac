// The light of the scene, in place of meshcat's: a sky and a ground, and a lamp to the left of the first view, whose shadows
// fall on parts where pictures are complete. What parts reflect is in their material.

import { DirectionalLight, HemisphereLight, PCFSoftShadowMap } from "three";
import { simplify } from "./material.js";

const REACH = 2.4; // of the view's units, to all sides: shadows are cast here

/** @param {View} view */
export function light(view) {
  const { viewer } = view;
  for (const name of ["SpotLight", "PointLightNegativeX", "PointLightPositiveX", "AmbientLight"]) viewer.delete_path(["Lights", name]);
  const lamp = new DirectionalLight(0xfffaf2, 0.58);
  lamp.position.set(1.6, -3.2, 4.4);
  const { shadow } = lamp;
  Object.assign(shadow.camera, { left: -REACH, right: REACH, top: REACH, bottom: -REACH, near: 1, far: 12 });
  shadow.mapSize.set(1024, 1024);
  shadow.radius = 3;
  shadow.bias = -0.0005;
  shadow.normalBias = 0.012;
  const back = new DirectionalLight(0xe8efff, 0.14);
  back.position.set(-3, 2, 1);
  const sky = new HemisphereLight(0x989da4, 0x454340, 1);
  sky.position.set(0, 0, 1); // z is up
  viewer.set_object(["Lights", "Lamp"], lamp);
  viewer.set_object(["Lights", "FillLight"], back);
  viewer.set_object(["Lights", "Sky"], sky);
  viewer.renderer.shadowMap.enabled = true;
  viewer.renderer.shadowMap.type = PCFSoftShadowMap;
  view.before((drawn) => {
    const { complete } = view.resolution;
    if (!drawn && lamp.castShadow === complete) return;
    lamp.castShadow = complete;
    simplify(view.root, !complete);
  });
}
