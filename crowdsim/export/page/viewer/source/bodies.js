// The joints of any agent at any time: captured, steered, or after a switch between both.

import { multiply } from "./quaternions.js";
import { NodePoses } from "./node_poses.js";
import { PlantedFeet } from "./planted_feet.js";
import { SteeredBodies, readGaits } from "./steered_bodies.js";
import { SwitchBlends } from "./switch_blends.js";

export class Bodies {
  constructor(block, source) {
    this.source = source;
    const { parents, offsets } = block.facts.skeleton;
    this.parents = parents;
    this.offsets = offsets;
    this.joints = parents.length;
    this.nodes = new NodePoses(block);
    this.steered = new SteeredBodies(source, readGaits(block));
    this.root = new Float64Array(3);
    this.local = new Float64Array(4 * this.joints);
    this.positions = new Float64Array(3 * this.joints);
    this.rotations = new Float64Array(4 * this.joints);
    this.feet = new PlantedFeet(this, block);
    this.switches = new SwitchBlends(this, block);
  }

  /** Put the joints of an agent in the world into `positions` and `rotations`; return false if it is absent or has no motion. */
  pose(agent, frame) {
    if (!frame.state[agent]) return false;
    const { step, time } = frame;
    const stretch = this.steered.stretchAt(agent, step);
    if (stretch) this.steered.pose(agent, stretch, time, step, this.root, this.local);
    else if (frame.node[agent] >= 0) {
      this.nodes.pose(
        frame.node[agent], frame.previous[agent], frame.frame[agent],
        frame.x[agent], frame.y[agent], frame.heading[agent], this.root, this.local,
      );
      this.feet.pin(agent, frame.time, frame.node[agent], frame.frame[agent], this.root, this.local);
    } else return false;
    this.switches.apply(agent, time, step, this.root, this.local);
    this.forward();
    return true;
  }

  /** Places and rotations of all joints of the pose in hand. */
  forward() {
    this.place(this.root, this.local, this.positions, this.rotations);
  }

  /** Places (3 a joint) and rotations (4 a joint) of all joints from the root and the local rotations. */
  place(root, local, positions, rotations) {
    const { parents, offsets } = this;
    for (let joint = 0; joint < this.joints; joint++) {
      const parent = parents[joint];
      if (parent < 0) {
        for (let c = 0; c < 3; c++) positions[3 * joint + c] = root[c];
        for (let c = 0; c < 4; c++) rotations[4 * joint + c] = local[4 * joint + c];
        continue;
      }
      const q = rotations, p = 4 * parent, [ox, oy, oz] = offsets[joint];
      const tx = 2 * (q[p + 2] * oz - q[p + 3] * oy);
      const ty = 2 * (q[p + 3] * ox - q[p + 1] * oz);
      const tz = 2 * (q[p + 1] * oy - q[p + 2] * ox);
      const w = q[p];
      positions[3 * joint] = positions[3 * parent] + ox + w * tx + q[p + 2] * tz - q[p + 3] * ty;
      positions[3 * joint + 1] = positions[3 * parent + 1] + oy + w * ty + q[p + 3] * tx - q[p + 1] * tz;
      positions[3 * joint + 2] = positions[3 * parent + 2] + oz + w * tz + q[p + 1] * ty - q[p + 2] * tx;
      multiply(rotations, 4 * joint, rotations, p, local, 4 * joint);
      let sum = 0;
      for (let c = 0; c < 4; c++) sum += q[4 * joint + c] * q[4 * joint + c];
      const n = 1 / Math.sqrt(sum);
      for (let c = 0; c < 4; c++) q[4 * joint + c] *= n;
    }
  }

  /** The joints as rows of matrices (three texels a joint) into `out` from `at` on. */
  writeMatrices(out, at) {
    const { positions, rotations } = this;
    for (let joint = 0, o = at; joint < this.joints; joint++, o += 12) {
      const i = 4 * joint;
      const w = rotations[i], x = rotations[i + 1], y = rotations[i + 2], z = rotations[i + 3];
      out[o] = 1 - 2 * (y * y + z * z);
      out[o + 1] = 2 * (x * y - w * z);
      out[o + 2] = 2 * (x * z + w * y);
      out[o + 3] = positions[3 * joint];
      out[o + 4] = 2 * (x * y + w * z);
      out[o + 5] = 1 - 2 * (x * x + z * z);
      out[o + 6] = 2 * (y * z - w * x);
      out[o + 7] = positions[3 * joint + 1];
      out[o + 8] = 2 * (x * z - w * y);
      out[o + 9] = 2 * (y * z + w * x);
      out[o + 10] = 1 - 2 * (x * x + y * y);
      out[o + 11] = positions[3 * joint + 2];
    }
  }
}
