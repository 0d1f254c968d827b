// Where the eye is: all of the place in view, from above, behind an agent, or wherever it is moved to.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export const VIEWS = ["overview", "top", "follow", "free"];
const BEHIND = 5.2, ABOVE = 2.4; // meters of the eye from the agent that is followed, and above the floor
const ELEVATION = (38 * Math.PI) / 180;

export class Cameras {
  constructor(bounds, canvas) {
    this.bounds = bounds;
    this.camera = new THREE.PerspectiveCamera(32, 1, 0.1, 2000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = 0.495 * Math.PI;
    this.controls.minDistance = 1;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("start", () => {
      if (this.view !== "follow") this.view = "free";
      this.onMoved?.();
    });
    this.view = "overview";
    this.inset = { top: 0, bottom: 0, left: 0, right: 0 };
    this.size = [1, 1];
  }

  /** Fit the picture to a size [pixels]; `inset` is how much of each side the page covers [pixels]. */
  resize(width, height, inset) {
    this.size = [width, height];
    this.inset = inset;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.view === "overview" || this.view === "top") this.set(this.view);
  }

  /** Go to a view; `who` is the place and heading of the agent to be followed. */
  set(view, who = null) {
    this.view = view;
    if (view === "overview") {
      // Of several sides, the one from which the place fills the picture best.
      const sides = [-90, -65, -115, -40, -140, 0].map((degrees) => (degrees * Math.PI) / 180);
      const fits = sides.map((side) => this.fit(direction(side, ELEVATION)));
      const best = fits.reduce((a, b) => (b.distance < 0.93 * a.distance ? b : a));
      this.place(best);
    } else if (view === "top") {
      this.place(this.fit(direction(-Math.PI / 2, 0.4999 * Math.PI)));
    } else if (view === "follow" && who) {
      const c = Math.cos(who.heading), s = Math.sin(who.heading);
      this.controls.target.set(who.x, who.y, 1.05);
      this.camera.position.set(who.x - BEHIND * c + 0.8 * s, who.y - BEHIND * s - 0.8 * c, ABOVE);
      this.last = [who.x, who.y];
    }
    this.controls.update();
  }

  /** Move the eye with the agent that is followed, which is now at (x, y). */
  followTo(x, y) {
    const { target } = this.controls, { position } = this.camera;
    const dx = x - this.last[0], dy = y - this.last[1];
    target.x += dx;
    target.y += dy;
    position.x += dx;
    position.y += dy;
    this.last = [x, y];
    this.controls.update();
  }

  /** Put the eye at a place, looking at a target at a distance [m]. */
  place({ eye, target, distance }) {
    this.camera.position.copy(eye);
    this.controls.target.copy(target);
    this.controls.maxDistance = 6 * distance;
    this.camera.near = Math.max(0.05, 0.01 * distance);
    this.camera.far = 20 * distance;
    this.camera.updateProjectionMatrix();
  }

  /** The eye in a direction from which all eight corners of the place lie in the free part of the picture. */
  fit(toEye) {
    const { low, high } = this.bounds, [width, height] = this.size, { inset } = this;
    const corners = [];
    for (const x of [low[0], high[0]]) {
      for (const y of [low[1], high[1]]) for (const z of [0, high[2]]) corners.push(new THREE.Vector3(x, y, z));
    }
    const target = new THREE.Vector3(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0);
    let distance = 2 * Math.hypot(high[0] - low[0], high[1] - low[1]) + 2;
    const camera = this.camera.clone();
    const left = (2 * inset.left) / width - 0.97, right = 0.97 - (2 * inset.right) / width;
    const bottom = (2 * inset.bottom) / height - 0.97, top = 0.97 - (2 * inset.top) / height;
    const eye = new THREE.Vector3(), seen = new THREE.Vector3();
    for (let turn = 0; turn < 40; turn++) {
      eye.copy(target).addScaledVector(toEye, distance);
      camera.position.copy(eye);
      camera.near = 0.001;
      camera.far = 1e5;
      camera.lookAt(target);
      camera.updateProjectionMatrix();
      camera.updateMatrixWorld();
      let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
      for (const corner of corners) {
        seen.copy(corner).project(camera);
        x0 = Math.min(x0, seen.x);
        x1 = Math.max(x1, seen.x);
        y0 = Math.min(y0, seen.y);
        y1 = Math.max(y1, seen.y);
      }
      const scale = Math.max((x1 - x0) / (right - left), (y1 - y0) / (top - bottom));
      const up = Math.tan((0.5 * camera.fov * Math.PI) / 180) * distance;
      const e = camera.matrixWorld.elements;
      const dx = 0.5 * (x0 + x1 - (left + right) * scale) * up * camera.aspect;
      const dy = 0.5 * (y0 + y1 - (bottom + top) * scale) * up;
      target.addScaledVector(new THREE.Vector3(e[0], e[1], e[2]), dx).addScaledVector(new THREE.Vector3(e[4], e[5], e[6]), dy);
      distance *= 1 + 0.8 * (scale - 1);
    }
    return { eye: target.clone().addScaledVector(toEye, distance), target, distance };
  }
}

/** Unit vector to a side and an elevation [rad]. */
function direction(side, elevation) {
  return new THREE.Vector3(
    Math.cos(side) * Math.cos(elevation), Math.sin(side) * Math.cos(elevation), Math.sin(elevation),
  );
}
