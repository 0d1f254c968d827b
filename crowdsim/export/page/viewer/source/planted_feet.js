// Feet of captured bodies where they stand: crowdsim/motion/planted/pin_kernels.py in JavaScript.

import { conjugate, product, rotate, wrapAngle } from "./quaternions.js";
import { REACH } from "./body_parts.js";
import { bendLeg } from "./switch_blends.js";
import { FADES, FREE, FollowedFeet } from "./followed_feet.js";
import { Varints } from "./unpack.js";

const FARTHEST = 0.2, LOWEST = 0.1, NOTHING = 1e-9;
const UNIT = 10000; // of meters and radians
const SIDES = ["left", "right"];

const four = (values, joint) => Array.from(values.subarray(4 * joint, 4 * joint + 4));
const three = (values, joint) => Array.from(values.subarray(3 * joint, 3 * joint + 3));

export class PlantedFeet {
  constructor(bodies, block) {
    const { roles } = block.facts.skeleton;
    this.bodies = bodies;
    this.legs = SIDES.map((side) => ["hip", "knee", "ankle"].map((part) => roles[`${side}_${part}`]));
    this.balls = SIDES.map((side, k) => roles[`${side}_toe`] ?? this.legs[k][2]);
    this.across = block.array("feet_across");
    this.any = this.across.length > 0;
    this.bones = bodies.parents.map(() => -1);
    bodies.parents.forEach((parent, joint) => {
      const own = this.legs.flat().indexOf(joint);
      this.bones[joint] = own >= 0 ? own : parent >= 0 ? this.bones[parent] : -1;
    });
    this.positions = new Float64Array(3 * bodies.joints);
    this.world = new Float64Array(4 * bodies.joints);
    if (this.any) this.read(block);
  }

  /** Read the feet in nodes: see pack_feet of packed_feet.py. */
  read(block) {
    const { rows } = this.bodies.nodes, reader = new Varints(block.array("feet_rows"));
    this.places = new Float64Array(6 * rows);
    for (let column = 0; column < 6; column++) {
      for (let row = 0, value = 0; row < rows; row++) {
        value += reader.signed();
        this.places[6 * row + column] = value / UNIT;
      }
    }
    this.followed = new FollowedFeet(this, block);
  }

  /** The change that holds for each foot of an agent in a frame of a node, at a time [s]; null if there is none. */
  statesAt(agent, time, node, frame) {
    const { source } = this.bodies, place = Math.min(Math.max(time * source.rate, 0), source.steps - 1);
    const step = Math.floor(place + 1e-6), share = place - step;
    return this.followed.changesFrom(agent, step).map((all) => {
      let last = all.length - 1;
      while (last > 0 && all[last].share > share) last -= 1;
      // Rounding may put a change just before or behind the time: it holds in its own node only. In first steps of
      // chunks, the frame since which a foot fades is rounded to 1/100.
      for (const one of [all[last], all[last - 1], all[last + 1]]) {
        if (one && one.node === node && one.since <= frame + 6e-3) return one;
      }
      return null;
    });
  }

  /** Ball x, y [m] and heading [rad] of a foot in a frame of a node, relative to its first row. */
  placeInClip(foot, node, frame) {
    const { nodes } = this.bodies, first = nodes.first[node], whole = Math.floor(frame), part = frame - whole;
    const a = 6 * (first + whole) + 3 * foot, b = 6 * Math.min(first + whole + 1, first + nodes.frames[node]) + 3 * foot;
    const P = this.places;
    return [
      P[a] + part * (P[b] - P[a]), P[a + 1] + part * (P[b + 1] - P[a + 1]), P[a + 2] + part * wrapAngle(P[b + 2] - P[a + 2]),
    ];
  }

  /** Ball and heading of a foot as posed. */
  placeOf(foot) {
    const ankle = this.legs[foot][2], ball = this.balls[foot], across = this.across.subarray(3 * foot, 3 * foot + 3);
    const [x, y] = rotate(four(this.world, ankle), across[0], across[1], across[2]);
    return [this.positions[3 * ball], this.positions[3 * ball + 1], Math.atan2(-x, y)];
  }

  /** How far a foot is moved (x, y [m]) and turned [rad] from `place`, where it is posed; `one` is its state. */
  correction(one, foot, node, frame, place) {
    if (one === null || one.mode === FREE || one.node !== node) return [0, 0, 0];
    if (one.mode === FADES) {
      const u = Math.min(Math.max((frame - one.since) / Math.max(one.until - one.since, 1), 0), 1);
      const w = 1 - u * u * u * (10 + u * (6 * u - 15));
      return one.pose.map((value) => w * value);
    }
    const a = this.placeInClip(foot, node, one.since), b = this.placeInClip(foot, node, frame);
    const [dx, dy, turn] = inFrame(a, b), [x, y, h] = one.pose;
    const c = Math.cos(h), s = Math.sin(h);
    const way = [x + c * dx - s * dy - place[0], y + s * dx + c * dy - place[1]];
    way.forEach((value, axis) => (way[axis] = this.bodies.source.stepTracks.shorter(value, axis)));
    const far = Math.hypot(way[0], way[1]), share = far > FARTHEST ? FARTHEST / far : 1;
    return [share * way[0], share * way[1], wrapAngle(h + turn - place[2])];
  }

  /** Put the feet of a posed body where they stand. */
  pin(agent, time, node, frame, root, local) {
    if (!this.any) return;
    const { bodies, positions, world, legs } = this;
    const states = this.statesAt(agent, time, node, frame);
    bodies.place(root, local, positions, world);
    const places = [0, 1].map((foot) => this.placeOf(foot));
    const moved = places.map((place, foot) => this.correction(states[foot], foot, node, frame, place));
    if (moved.flat().reduce((sum, value) => sum + Math.abs(value), 0) < NOTHING) return;
    let down = 0;
    const bent = legs.map(([hip, knee, ankle], foot) => {
      const [h, n, a] = [hip, knee, ankle].map((joint) => three(positions, joint)), [dx, dy, yaw] = moved[foot];
      const c = Math.cos(yaw), s = Math.sin(yaw), [px, py] = places[foot], ox = a[0] - px, oy = a[1] - py;
      const target = [px + dx + c * ox - s * oy, py + dy + s * ox + c * oy, a[2]];
      const whole = far(h, n) + far(n, a), most = Math.max(REACH, far(h, a) / whole);
      const x = h[0] - target[0], y = h[1] - target[1], reach = most * whole;
      down = Math.max(down, h[2] - target[2] - Math.sqrt(Math.max(reach * reach - x * x - y * y, 0)));
      return { h, n, a, most, target, thigh: four(world, hip), shank: four(world, knee) };
    });
    down = Math.min(down, LOWEST);
    root[2] -= down;
    const hinge = rotate(four(world, 0), 0, 1, 0);
    const turns = [];
    bent.forEach((leg, foot) => {
      for (const point of [leg.h, leg.n, leg.a]) point[2] -= down;
      const { thigh, shank } = bendLeg(leg, leg.target, hinge), yaw = moved[foot][2];
      turns.push(product(thigh, conjugate(leg.thigh)), product(shank, conjugate(leg.shank)));
      turns.push([Math.cos(yaw / 2), 0, 0, Math.sin(yaw / 2)]);
    });
    // Only joints that do not turn with the same bone as their parent get another local rotation.
    this.bones.forEach((bone, joint) => {
      const parent = bodies.parents[joint], before = parent >= 0 ? this.bones[parent] : -1;
      if (bone === before) return;
      const own = product(turns[bone], four(world, joint)), over = four(world, parent);
      local.set(product(conjugate(before >= 0 ? product(turns[before], over) : over), own), 4 * joint);
    });
  }
}

/** Planar pose b in the frame of a. */
function inFrame(a, b) {
  const c = Math.cos(a[2]), s = Math.sin(a[2]), dx = b[0] - a[0], dy = b[1] - a[1];
  return [c * dx + s * dy, -s * dx + c * dy, b[2] - a[2]];
}

/** Distance between two points. */
function far(a, b) {
  return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}
