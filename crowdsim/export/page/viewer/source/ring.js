// A ring on the floor around the selected agent.

import * as THREE from "three";
import { lineMaterial } from "./shaders.js";

export function ring() {
  const material = lineMaterial([0.05, 0.35, 0.75], [0.55, 0.8, 1], { floor: true, opacity: 0.9 });
  material.vertexShader = /* glsl */ `
    void main() { gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`;
  const mesh = new THREE.Mesh(new THREE.RingGeometry(0.38, 0.45, 48), material);
  mesh.renderOrder = -12;
  mesh.visible = false;
  return mesh;
}
