// All bodies: near ones with every joint, distant ones with few vertices and poses made beforehand.

import * as THREE from "three";
import { bodyMaterial, shadowMaterial } from "./shaders.js";
import { FarPoses } from "./far_poses.js";

const NEAREST = 60; // number of bodies that are drawn in detail if many are present
const WIDE = 64; // agents in a line of the texture of looks
const TISSUES = 5;

export class Crowd {
  constructor(block, source, bodies) {
    const { facts } = block;
    this.source = source;
    this.bodies = bodies;
    this.levels = facts.levels;
    this.group = new THREE.Group();
    this.chosen = { value: -1 };
    this.builds = block.array("builds"); // stature, girth, and shade of the shirt
    this.looks = { value: looksTexture(block.array("looks"), source.count) };
    const capacity = Math.max(1, Math.min(facts.most, facts.levels));
    const texels = 3 * bodies.joints;
    this.matrices = new Float32Array(4 * texels * capacity);
    this.texture = new THREE.DataTexture(this.matrices, texels, capacity, THREE.RGBAFormat, THREE.FloatType);
    this.near = new Level(block, "near", capacity, this.texture, 1, this.looks, this.chosen, facts, false);
    this.group.add(this.near.shadows, this.near.mesh);
    this.far = null;
    if ("far" in facts.bodies) {
      this.poses = new FarPoses(bodies, facts);
      this.far = new Level(
        block, "far", facts.most, this.poses.texture, this.poses.perLine, this.looks, this.chosen, facts, true,
      );
      this.group.add(this.far.shadows, this.far.mesh);
    }
    this.order = [];
    this.vertices = 0;
  }

  /** Show a frame. color: a function from an agent to the RGB (0 to 255) of its shirt. */
  update(frame, camera, color) {
    const present = this.order;
    present.length = 0;
    for (let agent = 0; agent < this.source.count; agent++) {
      if (frame.state[agent] && (frame.node[agent] >= 0 || frame.steered[agent])) present.push(agent);
    }
    let near = present, far = [];
    if (this.far && present.length > this.levels) {
      [near, far] = nearest(present, frame, camera.position, NEAREST);
    }
    let row = 0;
    const size = 12 * this.bodies.joints;
    for (const agent of near) {
      if (!this.bodies.pose(agent, frame)) continue;
      this.bodies.writeMatrices(this.matrices, row * size);
      this.near.put(row, agent, row, color(agent), this.builds);
      row += 1;
    }
    this.texture.needsUpdate = true;
    this.near.finish(row);
    if (this.far) {
      far.forEach((agent, k) => {
        this.far.put(k, agent, this.poses.rowOf(agent, frame, this.source), color(agent), this.builds);
        this.far.track.setXYZ(k, frame.x[agent], frame.y[agent], frame.heading[agent]);
      });
      this.far.track.needsUpdate = true;
      this.far.finish(far.length);
    }
    this.vertices = row * this.near.vertices + far.length * (this.far ? this.far.vertices : 0);
  }
}

/** One level of detail: a body, and its shadows on the floor. */
class Level {
  constructor(block, name, capacity, texture, perLine, looks, chosen, facts, far) {
    const bones = {
      joints: { value: texture }, perLine: { value: perLine }, texels: { value: 3 * facts.skeleton.parents.length },
    };
    this.row = new THREE.InstancedBufferAttribute(new Float32Array(capacity), 1);
    this.agent = new THREE.InstancedBufferAttribute(new Float32Array(capacity), 1);
    this.shirt = new THREE.InstancedBufferAttribute(new Uint8Array(3 * capacity), 3, true);
    this.build = new THREE.InstancedBufferAttribute(new Float32Array(2 * capacity), 2);
    this.track = new THREE.InstancedBufferAttribute(new Float32Array(3 * (far ? capacity : 1)), 3);
    const body = bodyGeometry(block, name);
    for (const [key, attribute] of [["row", this.row], ["agent", this.agent], ["shirt", this.shirt], ["build", this.build]]) {
      body.setAttribute(key, attribute);
    }
    const shadow = shadowGeometry(facts.skeleton.roles, far);
    shadow.setAttribute("row", this.row);
    if (far) {
      body.setAttribute("track", this.track);
      shadow.setAttribute("track", this.track);
    }
    this.mesh = new THREE.Mesh(body, bodyMaterial({ ...bones, looks, chosen }, far));
    this.shadows = new THREE.Mesh(shadow, shadowMaterial(bones, far));
    this.shadows.renderOrder = -10;
    for (const mesh of [this.mesh, this.shadows]) mesh.frustumCulled = false;
    this.vertices = facts.bodies[name];
  }

  put(at, agent, row, shirt, builds) {
    this.row.array[at] = row;
    this.agent.array[at] = agent;
    this.shirt.array.set(shirt, 3 * at);
    this.build.setXY(at, builds[3 * agent], builds[3 * agent + 1]);
  }

  finish(count) {
    this.mesh.geometry.instanceCount = count;
    this.shadows.geometry.instanceCount = count;
    this.mesh.visible = this.shadows.visible = count > 0;
    for (const attribute of [this.row, this.agent, this.shirt, this.build]) attribute.needsUpdate = true;
  }
}

function bodyGeometry(block, name) {
  const geometry = new THREE.InstancedBufferGeometry();
  const places = block.array(`${name}_places`), joints = block.array(`${name}_joints`);
  const count = joints.length / 2;
  const split = (values, size, first, scale) => {
    const out = new Float32Array(size * count);
    for (let v = 0; v < count; v++) {
      for (let c = 0; c < size; c++) out[size * v + c] = values[2 * size * v + first * size + c] * scale;
    }
    return out;
  };
  const add = (key, values, size) => geometry.setAttribute(key, new THREE.BufferAttribute(values, size));
  const unit = 1 / 20000;
  add("position", split(places, 3, 0, unit), 3);
  add("place1", split(places, 3, 1, unit), 3);
  add("joint0", split(joints, 1, 0, 1), 1);
  add("joint1", split(joints, 1, 1, 1), 1);
  add("weight", Float32Array.from(block.array(`${name}_weights`), (w) => w / 255), 1);
  add("tissue", Float32Array.from(block.array(`${name}_tissue`)), 1);
  const normals = block.array(`${name}_normals`);
  add("normal", split(normals, 3, 0, 1 / 127), 3);
  add("normal1", split(normals, 3, 1, 1 / 127), 3);
  add("fullness", Float32Array.from(block.array(`${name}_fullness`), (w) => w / 255), 1);
  geometry.setIndex(new THREE.BufferAttribute(block.array(`${name}_triangles`), 1));
  return geometry;
}

/** Soft discs: a wide one under the hips, and one under each foot of near bodies. */
function shadowGeometry(roles, far) {
  const geometry = new THREE.InstancedBufferGeometry();
  const discs = [[roles.hips ?? 0, far ? 0.42 : 0.4, far ? 0.42 : 0.26]];
  if (!far) for (const side of ["left", "right"]) discs.push([roles[`${side}_toe`] ?? roles[`${side}_ankle`], 0.17, 0.5]);
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
  const places = [], joints = [], sizes = [], dark = [], index = [];
  discs.forEach(([joint, size, darkness], k) => {
    for (const [x, y] of corners) {
      places.push(x, y, 0);
      joints.push(joint);
      sizes.push(size);
      dark.push(darkness);
    }
    index.push(4 * k, 4 * k + 1, 4 * k + 2, 4 * k, 4 * k + 2, 4 * k + 3);
  });
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
  geometry.setAttribute("joint", new THREE.Float32BufferAttribute(joints, 1));
  geometry.setAttribute("size", new THREE.Float32BufferAttribute(sizes, 1));
  geometry.setAttribute("dark", new THREE.Float32BufferAttribute(dark, 1));
  geometry.setIndex(index);
  return geometry;
}

function looksTexture(looks, count) {
  const lines = Math.max(1, Math.ceil(count / WIDE)), data = new Uint8Array(4 * WIDE * TISSUES * lines);
  for (let k = 0; k < count * TISSUES; k++) {
    const agent = Math.floor(k / TISSUES), tissue = k % TISSUES;
    const at = 4 * (Math.floor(agent / WIDE) * WIDE * TISSUES + (agent % WIDE) * TISSUES + tissue);
    for (let c = 0; c < 3; c++) data[at + c] = looks[3 * k + c];
    data[at + 3] = 255;
  }
  const texture = new THREE.DataTexture(data, WIDE * TISSUES, lines);
  texture.needsUpdate = true;
  return texture;
}

/** The `count` agents nearest to the eye, and the others. */
function nearest(present, frame, eye, count) {
  const far = present.map((agent) => {
    const x = frame.x[agent] - eye.x, y = frame.y[agent] - eye.y;
    return x * x + y * y;
  });
  const limit = Float64Array.from(far).sort()[Math.min(count, far.length) - 1];
  const near = [], rest = [];
  present.forEach((agent, k) => (far[k] <= limit && near.length < count ? near : rest).push(agent));
  return [near, rest];
}
