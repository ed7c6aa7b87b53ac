import { Camera, Object3D } from "three";

export class TransformControls extends Object3D {
  constructor(camera: Camera, element: HTMLElement);
  camera: Camera;
  enabled: boolean;
  dragging: boolean;
  axis: string | null;
  space: "local" | "world";
  size: number;
  attach(object: Object3D): this;
  detach(): this;
  setMode(mode: string): void;
  pointerHover(pointer: object): void;
  _getPointer(event: PointerEvent): object;
  addEventListener(name: string, listener: (event: any) => void): void;
}
