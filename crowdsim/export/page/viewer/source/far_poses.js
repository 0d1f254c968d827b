// Poses of distant bodies, made beforehand in one texture: every row of every node, and walks at several strides for steered
// agents.

import * as THREE from "three";
import { planSteps, STEP } from "./footsteps.js";
import { poseBody } from "./deformed.js";

const LINE = 4096; // texels of a line of the texture
const PHASES = 24; // poses of a cycle
const SHARES = [0, 0.35, 0.7, 1]; // of the clip's stride
const WALK_RATIO = 0.39; // squared meters of a step for each meter a second
const SECONDS = 8;

export class FarPoses {
  constructor(bodies, facts) {
    this.nodes = bodies.nodes;
    this.models = bodies.steered.models;
    this.texels = 3 * bodies.joints;
    this.perLine = Math.floor(LINE / this.texels);
    const gaits = this.models.length * SHARES.length * PHASES;
    const rows = Math.max(1, this.nodes.rows + gaits), lines = Math.ceil(rows / this.perLine);
    this.data = new Float32Array(4 * LINE * lines);
    this.bodies = bodies;
    this.cut(facts);
    this.texture = new THREE.DataTexture(this.data, LINE, lines, THREE.RGBAFormat, THREE.FloatType);
    this.texture.needsUpdate = true;
  }

  /** Fill the texture: rows of nodes first, then the walks of each behavior at each share. */
  cut() {
    const { nodes, bodies } = this;
    for (let row = 0; row < nodes.rows; row++) {
      for (let k = 0; k < 3; k++) bodies.root[k] = nodes.root[3 * row + k];
      const first = 4 * row * bodies.joints;
      for (let k = 0; k < 4 * bodies.joints; k++) bodies.local[k] = nodes.rotations[first + k];
      this.write(row);
    }
    this.models.forEach((model, behavior) => {
      SHARES.forEach((share, s) => this.walk(model, share, nodes.rows + (behavior * SHARES.length + s) * PHASES));
    });
  }

  /** A cycle of a body that walks straight ahead with a share of the clip's stride. */
  walk(model, share, firstRow) {
    const { bodies } = this, walk = this.models[this.models.length - 1];
    const half = 0.5 * Math.max(share, 0.05) * model.stride, speed = share ? (half * half) / WALK_RATIO : 0;
    const rate = share ? speed / (2 * half) : 0, count = Math.round(SECONDS / STEP);
    const track = new Float64Array(4 * count);
    for (let k = 0; k < count; k++) {
      track[4 * k] = speed * k * STEP;
      track[4 * k + 3] = 5.06 + rate * k * STEP;
    }
    const plan = planSteps(walk, track, count);
    const from = Math.ceil(5.06 + rate * 3);
    for (let p = 0; p < PHASES; p++) {
      const time = share ? (from + p / PHASES - 5.06) / rate : 4;
      poseBody(model, plan, Math.min(time, SECONDS - 0.5), bodies.root, bodies.local);
      bodies.root[0] -= speed * Math.min(time, SECONDS - 0.5);
      this.write(firstRow + p);
    }
  }

  /** Write the body in hand to a row. */
  write(row) {
    this.bodies.forward();
    const at = 4 * (Math.floor(row / this.perLine) * LINE + (row % this.perLine) * this.texels);
    this.bodies.writeMatrices(this.data, at);
  }

  /** The row of the pose that is nearest to that of an agent in a frame. */
  rowOf(agent, frame, source) {
    const node = frame.node[agent];
    const stretch = this.bodies.steered.stretchAt(agent, frame.step);
    if (!stretch) return node < 0 ? 0 : this.nodes.first[node] + Math.round(frame.frame[agent]);
    const i = Math.min(frame.step - stretch.begin, stretch.phases.length - 2);
    const rate = (stretch.phases[i + 1] - stretch.phases[i]) * source.rate;
    const model = this.models[frame.behavior[agent]];
    const share = frame.speed[agent] / Math.max(rate, 0.45) / model.stride;
    let nearest = 0;
    for (let s = 1; s < SHARES.length; s++) if (Math.abs(SHARES[s] - share) < Math.abs(SHARES[nearest] - share)) nearest = s;
    const phase = stretch.phases[i] + frame.share * (stretch.phases[i + 1] - stretch.phases[i]);
    const p = Math.round((phase - Math.floor(phase)) * PHASES) % PHASES;
    return this.nodes.rows + (frame.behavior[agent] * SHARES.length + nearest) * PHASES + p;
  }
}
