// Rows of the nodes of a motion graph, and bodies that play them: crowdsim/motion/graph/pose_kernels.py in JavaScript.

import { BLEND_FRAMES, blendWeight, nodeRows } from "./node_tracks.js";
import { Varints } from "./unpack.js";
import { difference, multiply, partThen, wrapAngle } from "./quaternions.js";

export class NodePoses {
  constructor(block) {
    const { facts } = block;
    this.joints = facts.skeleton.parents.length;
    Object.assign(this, nodeRows(block));
    const rows = (this.rows = this.first[this.frames.length]);
    this.root = new Float32Array(3 * rows);
    this.rotations = new Float32Array(4 * this.joints * rows);
    const reader = new Varints(block.array("node_rows"));
    for (let column = 0; column < 3; column++) {
      for (let row = 0, value = 0; row < rows; row++) {
        value += reader.signed();
        this.root[3 * row + column] = value / facts.units.root;
      }
    }
    for (let joint = 0; joint < this.joints; joint++) this.readJoint(reader, joint, facts.units.rotation);
    this.scratch = new Float64Array(4);
    this.turned = new Float64Array(4);
  }

  /** Read the rotation vectors of a joint in all rows, and keep them as quaternions. */
  readJoint(reader, joint, unit) {
    const vectors = new Float64Array(3 * this.rows);
    for (let column = 0; column < 3; column++) {
      for (let row = 0, value = 0; row < this.rows; row++) {
        value += reader.signed();
        vectors[3 * row + column] = value / unit;
      }
    }
    for (let row = 0; row < this.rows; row++) {
      const x = vectors[3 * row], y = vectors[3 * row + 1], z = vectors[3 * row + 2];
      const angle = Math.hypot(x, y, z), scale = angle < 1e-9 ? 0.5 : Math.sin(angle / 2) / angle;
      const o = 4 * (row * this.joints + joint);
      this.rotations[o] = Math.cos(angle / 2);
      this.rotations[o + 1] = scale * x;
      this.rotations[o + 2] = scale * y;
      this.rotations[o + 3] = scale * z;
    }
  }

  /** Heading of the root in a row [rad]. */
  yawOf(row) {
    const q = this.rotations, i = 4 * row * this.joints;
    return Math.atan2(2 * (q[i + 1] * q[i + 2] + q[i] * q[i + 3]), 1 - 2 * (q[i + 2] * q[i + 2] + q[i + 3] * q[i + 3]));
  }

  /** Pose of a body at a track pose: its root into `root` (3), local rotations, the first in the world, into `out`. */
  pose(node, previous, frame, x, y, heading, root, out) {
    const first = this.first[node], whole = Math.floor(frame), part = frame - whole;
    const row = first + whole, after = Math.min(row + 1, first + this.frames[node]);
    let old = first, w = 0;
    if (previous >= 0 && frame < BLEND_FRAMES) {
      w = blendWeight(frame);
      old = this.first[previous] + this.frames[previous];
    }
    const R = this.root;
    const at = (k) => R[3 * row + k] + part * (R[3 * after + k] - R[3 * row + k]);
    let px = at(0), py = at(1);
    if (w > 0) {
      const apart = wrapAngle(this.yawOf(old) - this.yawOf(first));
      const dx = px - w * R[3 * first], dy = py - w * R[3 * first + 1];
      let c = Math.cos(w * apart), s = Math.sin(w * apart);
      px = c * dx - s * dy;
      py = s * dx + c * dy;
      c = Math.cos((w - 1) * apart);
      s = Math.sin((w - 1) * apart);
      px += w * (c * R[3 * old] - s * R[3 * old + 1]);
      py += w * (s * R[3 * old] + c * R[3 * old + 1]);
    }
    const c = Math.cos(heading), s = Math.sin(heading);
    root[0] = x + c * px - s * py;
    root[1] = y + s * px + c * py;
    root[2] = at(2) + w * (R[3 * old + 2] - R[3 * first + 2]);
    for (let joint = 0; joint < this.joints; joint++) this.joint(row, after, part, old, first, w, joint, out);
    const turn = [Math.cos(heading / 2), 0, 0, Math.sin(heading / 2)];
    multiply(out, 0, turn, 0, out, 0);
  }

  /** Rotation of a joint between two rows, with the share `w` of the offset of the old node, into `out`. */
  joint(row, after, part, old, first, w, joint, out) {
    const Q = this.rotations, J = this.joints, q = this.turned;
    const a = 4 * (row * J + joint), b = 4 * (after * J + joint), o = 4 * joint;
    if (part > 0) {
      const dot = Q[a] * Q[b] + Q[a + 1] * Q[b + 1] + Q[a + 2] * Q[b + 2] + Q[a + 3] * Q[b + 3];
      const share = dot >= 0 ? part : -part;
      let sum = 0;
      for (let k = 0; k < 4; k++) {
        q[k] = (1 - part) * Q[a + k] + share * Q[b + k];
        sum += q[k] * q[k];
      }
      const n = 1 / Math.sqrt(sum);
      for (let k = 0; k < 4; k++) q[k] *= n;
    } else {
      for (let k = 0; k < 4; k++) q[k] = Q[a + k];
    }
    if (w > 0) {
      difference(this.scratch, 0, Q, 4 * (old * J + joint), Q, 4 * (first * J + joint));
      partThen(out, o, this.scratch, 0, w, q, 0);
    } else {
      for (let k = 0; k < 4; k++) out[o + k] = q[k];
    }
  }
}
