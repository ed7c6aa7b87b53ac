// What parts are made of: paint that reflects its surroundings. Light is added up as it is, and colours are those that the
// screen is sent (sRGB), in and out: a face in full light has exactly the colour of its material.
//
// On a dark page dark colours are brighter, so that they are seen before it.
//
// Where pictures take too long, parts are matt while something moves: the same light, computed at their corners.

import { DoubleSide, Mesh, MeshLambertMaterial, MeshStandardMaterial } from "three";
import { theme } from "./theme.js";

const ROUGHNESS = 0.42;
const METALNESS = 0.05;

const DARKEST = 0.2; // brightness of colours on a dark page
const BRIGHTER = 2.5; // most, so that black stays darker than others
const least = { value: 0 };

// As sRGB, nearly; a power takes long where there is no graphics card.
const LINEAR = `
  diffuseColor.rgb *= diffuseColor.rgb;
  diffuseColor.rgb *= clamp(least / max(dot(diffuseColor.rgb, vec3(0.21, 0.72, 0.07)), 1e-3), 1.0, ${BRIGHTER.toFixed(1)});`;

// Light above one is dimmed by its brightest colour, so that no hue changes.
const SEEN = `
  float brightest = max(max(gl_FragColor.r, gl_FragColor.g), gl_FragColor.b);
  float dimmed = brightest < 0.8 ? brightest : 1.0 - 0.04 / (brightest - 0.6);
  gl_FragColor.rgb = sqrt(gl_FragColor.rgb * dimmed / max(brightest, 1e-4));`;

// What is reflected: a sky, a ground, and panels of light to the left, behind and to the right, the blurrier the rougher.
const ROOM = `
  float panel(vec3 ray, vec3 middle, float size, float blur) {
    return smoothstep(cos(size + blur), cos(max(size - blur, 0.0)), dot(ray, middle));
  }
  vec3 room(vec3 ray, float blur) {
    float light = 2.6 * panel(ray, vec3(-0.62, 0.5, 0.6), 0.35, blur);
    light += 1.5 * panel(ray, vec3(0.86, 0.44, -0.26), 0.4, blur) + 1.1 * panel(ray, vec3(-0.3, 0.3, -0.9), 0.5, blur);
    return vec3(light) + mix(vec3(0.05), vec3(0.24, 0.25, 0.27), smoothstep(-0.2 - blur, 0.3 + blur, ray.y));
  }
  void main() {`;
const REFLECTED = `
  radiance += room(inverseTransformDirection(reflect(-geometry.viewDir, geometry.normal), viewMatrix), material.roughness);`;

/** @param {import("three").Shader} shader */
function lit(shader) {
  shader.uniforms.least = least;
  shader.fragmentShader = `uniform float least;\n${shader.fragmentShader}`
    .replace("#include <color_fragment>", `#include <color_fragment>${LINEAR}`)
    .replace("#include <encodings_fragment>", SEEN);
}

/** @param {import("three").Shader} shader */
function glossy(shader) {
  lit(shader);
  shader.fragmentShader = shader.fragmentShader.replace("void main() {", ROOM)
    .replace("#include <lights_fragment_maps>", `#include <lights_fragment_maps>${REFLECTED}`);
}

theme.follow(() => {
  least.value = theme.dark ? DARKEST : 0;
});

/**
 * Give parts the materials that they are drawn with.
 * @param {import("three").Object3D} object as the server's commands have it
 */
export function dress(object) {
  object.traverse((part) => {
    if (!(part instanceof Mesh) || !(part.material instanceof MeshLambertMaterial)) return;
    const matt = part.material;
    const { color, emissive, map, opacity, transparent, vertexColors } = matt;
    const paint = new MeshStandardMaterial({ map, opacity, transparent, vertexColors, side: DoubleSide, roughness: ROUGHNESS, metalness: METALNESS });
    Object.assign(paint, { color, emissive }); // both have the same
    paint.onBeforeCompile = glossy;
    matt.onBeforeCompile = lit;
    part.geometry.addEventListener("dispose", () => [matt, paint].forEach((material) => material.dispose()));
    part.userData.made = { matt, paint };
    part.material = paint;
  });
}

/** Draw parts as paint, or matt. @param {import("three").Object3D} root @param {boolean} matt */
export function simplify(root, matt) {
  root.traverse((part) => {
    if (part.userData.made) /** @type {Mesh} */ (part).material = matt ? part.userData.made.matt : part.userData.made.paint;
  });
}
