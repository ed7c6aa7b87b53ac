// The hand: a part of a robot is taken where it is touched, and led in the plane of the view through that point.
//
// Everything below the group "cinegen" is in the robots' own metres, z up; what the view does with it (turning, scaling)
// is in that group's matrix. Its children are the robots, theirs the nodes.

"use strict";

(function () {
  const THREE = MeshCat.THREE;
  const HINT = "Drag any part of the robot.";

  // Which robot and which node an object belongs to; null if none.
  function owner(object) {
    const path = [];
    for (let at = object; at !== null; at = at.parent) path.unshift(at);
    const root = path.findIndex((at) => at.name === "cinegen");
    if (root < 0 || path.length < root + 3) return null;
    return { robot: path[root + 1].name, node: path[root + 2].name, group: path[root + 2] };
  }

  class Hand {
    constructor(viewer, say) {
      this.viewer = viewer;
      this.say = say;
      this.ray = new THREE.Raycaster();
      this.plane = new THREE.Plane();
      this.held = null;
      this.lit = [];
      this.waiting = null;
      const canvas = viewer.renderer.domElement;
      canvas.style.touchAction = "none";
      canvas.addEventListener("pointerdown", (event) => this.take(event), true);
      canvas.addEventListener("pointermove", (event) => this.move(event), true);
      for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
        canvas.addEventListener(end, (event) => this.letGo(event), true);
      }
      window.addEventListener("keydown", (event) => { if (event.key === "Escape") this.letGo(null); });
      this.label = document.getElementById("hand");
      this.label.textContent = HINT;
    }

    get root() { return this.viewer.scene_tree.find(["meshcat", "cinegen"]).object; }

    aim(event) {
      const box = this.viewer.renderer.domElement.getBoundingClientRect();
      const at = new THREE.Vector2(
        (2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
      this.ray.setFromCamera(at, this.viewer.camera);
    }

    // The nearest thing under the pointer that belongs to a robot.
    touched(event) {
      this.aim(event);
      for (const hit of this.ray.intersectObject(this.root, true)) {
        if (!hit.object.isMesh) continue;
        const whose = owner(hit.object);
        if (whose !== null && whose.node !== "targets") return { ...whose, point: hit.point };
      }
      return null;
    }

    take(event) {
      if (!event.isPrimary || event.button !== 0 || this.held !== null) return;
      const hit = this.touched(event);
      if (hit === null) return;
      event.stopImmediatePropagation(); // the view stays where it is
      this.viewer.renderer.domElement.setPointerCapture(event.pointerId);
      const toward = this.viewer.camera.getWorldDirection(new THREE.Vector3());
      this.plane.setFromNormalAndCoplanarPoint(toward, hit.point);
      this.held = { ...hit, pointer: event.pointerId };
      const point = hit.group.worldToLocal(hit.point.clone()).toArray();
      this.say({ take: { robot: hit.robot, node: hit.node, point } });
      this.show(`${hit.node}: drag it, Esc lets go`);
    }

    move(event) {
      if (this.held === null) {
        if (event.buttons === 0) this.hover(event);
        return;
      }
      if (event.pointerId !== this.held.pointer) return;
      event.stopImmediatePropagation();
      this.aim(event);
      const met = this.ray.ray.intersectPlane(this.plane, new THREE.Vector3());
      if (met === null) return;
      if (this.waiting === null) { // one message for each picture
        requestAnimationFrame(() => {
          if (this.held !== null && this.waiting !== null) this.say({ lead: this.waiting });
          this.waiting = null;
        });
      }
      this.waiting = this.root.worldToLocal(met).toArray();
    }

    letGo(event) {
      if (this.held === null || (event !== null && event.pointerId !== this.held.pointer)) return;
      this.held = null;
      this.waiting = null;
      this.say({ "let go": true });
      this.show("");
    }

    hover(event) {
      const hit = this.touched(event);
      this.viewer.renderer.domElement.style.cursor = hit === null ? "" : "grab";
      this.light(hit === null ? null : hit.group);
      this.show(hit === null ? null : hit.node);
    }

    // Lights one node up, and the last one down.
    light(group) {
      if (this.group === group) return;
      for (const [material, before] of this.lit) material.emissive.setHex(before);
      this.lit = [];
      this.group = group;
      if (group !== null) {
        group.traverse((object) => {
          for (const material of [object.material].flat()) {
            if (material && material.emissive && this.lit.every(([other]) => other !== material)) {
              this.lit.push([material, material.emissive.getHex()]);
              material.emissive.setHex(0x333322);
            }
          }
        });
      }
      this.viewer.set_dirty();
    }

    show(text) {
      if (text !== null) this.label.textContent = text;
    }
  }

  window.CinegenHand = Hand;
})();
