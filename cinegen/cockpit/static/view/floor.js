// The floor: a grid that fades away from the centre; it replaces meshcat's grid.

import { Color, DoubleSide, Mesh, PlaneGeometry, ShaderMaterial } from "three";
import { theme } from "./theme.js";

const SIZE = 24; // of the view's units; robots fill about 3
const CELL = 0.5;

const VERTEX = `
  varying vec2 where;
  void main() {
    where = position.xy;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }`;

const FRAGMENT = `
  uniform vec3 colour;
  uniform float cell;
  varying vec2 where;
  float lines(vec2 at, float width) {
    vec2 wide = fwidth(at);
    vec2 off = abs(fract(at - 0.5) - 0.5) / max(wide * width, vec2(1e-6));
    return (1.0 - min(min(off.x, off.y), 1.0)) * (1.0 - smoothstep(0.3, 0.8, max(wide.x, wide.y)));
  }
  void main() {
    float far = smoothstep(1.5, 9.0, length(where));
    float strength = max(0.45 * lines(where / cell, 1.0), 0.9 * lines(where / (5.0 * cell), 1.2));
    gl_FragColor = vec4(colour, strength * (1.0 - far));
  }`;

/** Return the floor, in the scene. @param {View} view */
export function lay(view) {
  const material = new ShaderMaterial({
    uniforms: { colour: { value: new Color() }, cell: { value: CELL } },
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    transparent: true,
    depthWrite: false,
    side: DoubleSide,
    extensions: { derivatives: true },
  });
  const floor = new Mesh(new PlaneGeometry(SIZE, SIZE), material);
  floor.renderOrder = -1;
  view.viewer.set_object(["Grid"], floor);
  theme.follow(() => {
    material.uniforms.colour.value.setHex(theme.grid);
    view.changed();
  });
  return floor;
}
