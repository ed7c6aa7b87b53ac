// A soft shadow on the floor below robots and obstacles, darker where they are near it. The scene is seen from the floor
// upwards, at right angles, and the picture is blurred.

import { DoubleSide, Mesh, MeshBasicMaterial, OrthographicCamera, PlaneGeometry, Scene, ShaderMaterial, WebGLRenderTarget } from "three";

const SIZE = 10; // of the view's units; robots fill about 3
const HEIGHT = 4; // what is higher has no shadow
const PIXELS = 256;
const DARKNESS = 0.5;
const BLURS = [2.5, 1]; // pixels between samples, of two passes each

const VERTEX = `
  varying vec2 where;
  void main() {
    where = uv;
    vec4 at = vec4(position, 1.0);
    #ifdef USE_INSTANCING
      at = instanceMatrix * at;
    #endif
    gl_Position = projectionMatrix * modelViewMatrix * at;
  }`;

const HEIGHTS = `
  void main() {
    float low = 1.0 - gl_FragCoord.z;
    gl_FragColor = vec4(0.0, 0.0, 0.0, low * low);
  }`;

const BLUR = `
  uniform sampler2D picture;
  uniform vec2 step;
  varying vec2 where;
  void main() {
    float sum = 0.0;
    float weights = 0.0;
    for (int i = -4; i <= 4; i += 1) {
      float weight = exp(-0.14 * float(i * i));
      sum += weight * texture2D(picture, where + float(i) * step).a;
      weights += weight;
    }
    gl_FragColor = vec4(0.0, 0.0, 0.0, sum / weights);
  }`;

export class ContactShadow {
  #pictures = [new WebGLRenderTarget(PIXELS, PIXELS), new WebGLRenderTarget(PIXELS, PIXELS)];
  #upwards = new OrthographicCamera(-SIZE / 2, SIZE / 2, SIZE / 2, -SIZE / 2, 0, HEIGHT);
  #heights = new ShaderMaterial({ vertexShader: VERTEX, fragmentShader: HEIGHTS, side: DoubleSide });
  #blur = new ShaderMaterial({
    uniforms: { picture: { value: null }, step: { value: [0, 0] } },
    vertexShader: VERTEX,
    fragmentShader: BLUR,
    depthTest: false,
    depthWrite: false,
  });
  #flat = new Scene();
  #facing = new OrthographicCamera(-0.5, 0.5, 0.5, -0.5, -1, 1);
  #shadow;

  /** @param {View} view @param {Mesh} floor */
  constructor(view, floor) {
    this.view = view;
    this.floor = floor;
    const { texture } = this.#pictures[0];
    const material = new MeshBasicMaterial({
      map: texture, transparent: true, opacity: DARKNESS, depthWrite: false, side: DoubleSide,
    });
    this.#shadow = new Mesh(new PlaneGeometry(SIZE, SIZE), material);
    this.#shadow.scale.y = -1; // seen from below
    this.#shadow.renderOrder = floor.renderOrder;
    this.#upwards.rotation.x = Math.PI;
    floor.add(this.#shadow, this.#upwards);
    this.#flat.add(new Mesh(new PlaneGeometry(1, 1), this.#blur));
    view.last(() => {
      this.#shadow.visible = view.resolution.complete;
      if (this.#shadow.visible) this.#cast();
    });
  }

  #cast() {
    const { renderer, scene } = this.view.viewer;
    const { background } = scene;
    const xr = renderer.xr.enabled;
    const hidden = [this.floor, this.view.level].filter(({ visible }) => visible);
    renderer.xr.enabled = false;
    scene.background = null;
    scene.overrideMaterial = this.#heights;
    for (const object of hidden) object.visible = false;
    this.floor.updateWorldMatrix(true, true);
    this.#paint(scene, this.#upwards, 0);
    for (const object of hidden) object.visible = true;
    scene.overrideMaterial = null;
    scene.background = background;
    for (const pixels of BLURS) {
      this.#blurAlong([pixels / PIXELS, 0], 0);
      this.#blurAlong([0, pixels / PIXELS], 1);
    }
    renderer.setRenderTarget(null);
    renderer.xr.enabled = xr;
  }

  /**
   * @param {number[]} step between samples, of the picture's size
   * @param {number} from index of the picture that is blurred into the other one
   */
  #blurAlong(step, from) {
    this.#blur.uniforms.picture.value = this.#pictures[from].texture;
    this.#blur.uniforms.step.value = step;
    this.#paint(this.#flat, this.#facing, 1 - from);
  }

  /** @param {Scene} scene @param {OrthographicCamera} camera @param {number} into index of the picture */
  #paint(scene, camera, into) {
    const { renderer } = this.view.viewer;
    const alpha = renderer.getClearAlpha();
    renderer.setRenderTarget(this.#pictures[into]);
    renderer.setClearAlpha(0);
    renderer.clear();
    renderer.render(scene, camera);
    renderer.setClearAlpha(alpha);
  }
}
