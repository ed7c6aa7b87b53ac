// Types of what the page uses of meshcat's viewer, which is one script that sets `window.MeshCat`.

import type * as THREE from "three";

export interface Controls {
  target: THREE.Vector3;
  enabled: boolean;
  touches: { ONE: number; TWO: number };
  update(): void;
  addEventListener(type: string, listener: () => void): void;
}

export interface Control {
  min(): Control;
  max(): Control;
  step(): Control;
  onChange(): Control;
  updateDisplay(): Control;
}

export interface Folder {
  domElement: HTMLElement;
  __folders: Record<string, Folder>;
  addFolder(): Folder;
  add(): Control;
  remove(): Control;
  removeFolder(): Control;
}

export interface SceneNode {
  folder: Folder;
  object: THREE.Object3D;
  children: Record<string, SceneNode>;
  on_update: () => void;
  find(path: string[]): SceneNode;
}

export interface Viewer {
  gui: { domElement: HTMLElement };
  renderer: THREE.WebGLRenderer;
  scene: THREE.Scene;
  scene_tree: SceneNode;
  camera: THREE.PerspectiveCamera;
  controls: Controls;
  connection: WebSocket;
  needs_render: boolean;
  num_messages_received: number;
  connect(url: string): void;
  delete_path(path: string[]): void;
  handle_command(command: { type?: string; path?: string; property?: string }): void;
  handle_command_message(message: { data: Uint8Array }): void;
  render(): void;
  set_3d_pane_size(width?: number, height?: number): void;
  set_dirty(): void;
  set_object(path: string[], object: THREE.Object3D): void;
}

declare global {
  interface Window {
    MeshCat: {
      THREE: typeof THREE;
      Viewer: { new (pane: HTMLElement, animate: boolean, renderer?: THREE.WebGLRenderer): Viewer; prototype: Viewer };
    };
    cockpit: object;
  }
}
