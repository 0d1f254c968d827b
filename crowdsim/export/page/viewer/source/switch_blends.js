// Bodies that have just gone over between captured and steered: the new motion, and what is left of the old one.
// crowdsim/recording/shown/switch_offsets.py, switch_blends.py and motion/clips/leg_solver.py in JavaScript.

import { conjugate, product, rotate, wrapAngle } from "./quaternions.js";
import { REACH } from "./body_parts.js";
import { varints } from "./unpack.js";

const FADE = 0.3; // seconds
const LONGEST = 5.5; // seconds after which both feet are right
const FASTEST = 1.5, FASTEST_TURN = 8; // of what fades on [m/s], [rad/s]
const OWN_STEP = 1.5, HIGHEST = 0.05, BENT = 0.05;
const LAPSE = 1 / 60; // seconds
const SIDES = ["left", "right"];

const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const minus = (a, b) => add(a, b, -1);
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const far = (a) => Math.sqrt(dot(a, a));
const unit = (a) => scaled(a, 1 / Math.max(far(a), 1e-12));
const turned = (q, v) => rotate(q, v[0], v[1], v[2]);
const four = (values, joint) => Array.from(values.subarray(4 * joint, 4 * joint + 4));
const three = (values, joint) => Array.from(values.subarray(3 * joint, 3 * joint + 3));
const aboutZ = (yaw) => [Math.cos(yaw / 2), 0, 0, Math.sin(yaw / 2)];

function rotationVector(q) {
  const sign = q[0] < 0 ? -1 : 1, sine = Math.hypot(q[1], q[2], q[3]);
  const scale = sign * (sine < 1e-9 ? 2 : (2 * Math.atan2(sine, sign * q[0])) / sine);
  return [scale * q[1], scale * q[2], scale * q[3]];
}

function turnOf(v) {
  const angle = far(v), scale = angle < 1e-9 ? 0.5 : Math.sin(angle / 2) / angle;
  return [Math.cos(angle / 2), scale * v[0], scale * v[1], scale * v[2]];
}

const bounded = (v, most) => scaled(v, Math.min(1, most / Math.max(far(v), 1e-12)));

/** Shares of a difference and of its speed that are left after `since` of `whole` seconds. */
function weights(since, whole) {
  const u = Math.min(Math.max(since / whole, 0), 1);
  return [1 - u * u * u * (10 + u * (6 * u - 15)), whole * u * (1 + u * u * (-6 + u * (8 - 3 * u)))];
}

export class SwitchBlends {
  constructor(bodies, block) {
    const { roles } = block.facts.skeleton;
    this.bodies = bodies;
    this.joints = bodies.joints;
    this.ankles = SIDES.map((side) => roles[`${side}_ankle`]);
    this.toes = SIDES.map((side, k) => roles[`${side}_toe`] ?? this.ankles[k]);
    this.legs = SIDES.map((side) => ["hip", "knee", "ankle"].map((part) => roles[`${side}_${part}`]));
    this.places = new Float64Array(3 * this.joints);
    this.world = new Float64Array(4 * this.joints);
    this.read(block);
  }

  read(block) {
    const { rate } = this.bodies.source;
    this.byAgent = new Map();
    const [agents, steps, feet] = ["agents", "steps", "feet"].map((name) => varints(block.array(`switch_${name}`)));
    const flags = block.array("switch_flags");
    for (let k = 0; k < agents.length; k++) {
      const time = steps[k] / rate, at = (n) => time + feet[5 * k + n] / 10000;
      const one = {
        step: steps[k], time, toSteered: (flags[k] & 1) > 0, forced: [flags[k] & 2, flags[k] & 4].map((flag) => flag > 0),
        hold: [at(0), at(1)], end: [at(2), at(3)], cut: feet[5 * k + 4] ? at(4) : Infinity, offsets: null,
      };
      one.until = Math.min(Math.max(time + FADE, ...one.end), one.cut, time + LONGEST);
      if (!this.byAgent.has(agents[k])) this.byAgent.set(agents[k], []);
      this.byAgent.get(agents[k]).push(one);
    }
  }

  /** Change a pose of the new motion to what is shown at a time, from a step on. */
  apply(agent, time, step, root, local) {
    const all = this.byAgent.get(agent);
    if (!all) return;
    let last = -1;
    while (last + 1 < all.length && all[last + 1].step <= step) last += 1;
    if (last < 0 || time >= all[last].until) return;
    const kept = { root: root.slice(), local: local.slice() };
    this.faded({ root, local }, this.offsetsOf(agent, all, last, kept), time);
  }

  /** What a switch changed, measured when it is asked for first; `kept` are poses that may be in use. */
  offsetsOf(agent, all, number, kept) {
    const one = all[number];
    if (one.offsets) return one.offsets;
    const { source, steered } = this.bodies;
    const played = this.playedAt(agent, one.step);
    const walk = (time, step) => {
      const body = this.newBody();
      steered.pose(agent, steered.stretchAt(agent, step), time, step, body.root, body.local);
      return body;
    };
    const captured = { now: played.now, later: played.later, lapse: played.lapse };
    const way = one.toSteered ? LAPSE : -LAPSE, from = one.toSteered ? one.step : one.step - 1;
    const walking = { now: walk(one.time, from), later: walk(one.time + way, from), lapse: way };
    const [old, next] = one.toSteered ? [captured, walking] : [walking, captured];
    // What is left of the switch before still changes the old motion.
    if (number > 0 && one.time < all[number - 1].until) {
      const rest = this.offsetsOf(agent, all, number - 1, kept);
      this.faded(old.now, rest, one.time);
      this.faded(old.later, rest, one.time + old.lapse);
    }
    one.offsets = this.between(one, old, next);
    return one.offsets;
  }

  newBody() {
    return { root: new Float64Array(3), local: new Float64Array(4 * this.joints) };
  }

  /** A captured body at a step, and in the next frame of its node, or the one before if there is none. */
  playedAt(agent, step) {
    const { source, nodes } = this.bodies, e = source.eventAt(agent, step);
    const node = source.eventNode[e], previous = source.eventPrevious[e];
    const [x, y, heading, frame] = source.trackAt(agent, step, new Float64Array(4));
    const beside = step + 1 < source.steps ? step + 1 : step - 1;
    const other = source.trackAt(agent, beside, new Float64Array(4));
    const way = frame + 1 <= nodes.frames[node] ? 1 : -1, share = way * source.rate * LAPSE * (beside - step);
    const now = this.newBody(), later = this.newBody();
    nodes.pose(node, previous, frame, x, y, heading, now.root, now.local);
    nodes.pose(
      node, previous, frame + way, x + share * (other[0] - x), y + share * (other[1] - y),
      heading + share * wrapAngle(other[2] - heading), later.root, later.local,
    );
    this.bodies.feet.pin(agent, step / source.rate, node, frame, now.root, now.local);
    this.bodies.feet.pin(agent, step / source.rate, node, frame + way, later.root, later.local);
    return { now, later, lapse: way * LAPSE };
  }

  forward(body) {
    this.bodies.place(body.root, body.local, this.places, this.world);
  }

  feet(body) {
    this.forward(body);
    return { balls: this.toes.map((toe) => three(this.places, toe)), turns: this.ankles.map((ankle) => four(this.world, ankle)) };
  }

  between(one, old, next) {
    const [was, wasLater, is, isLater] = [old.now, old.later, next.now, next.later].map((body) => this.feet(body));
    const offsets = { ...one, turns: [], turnSpeeds: [] };
    const speed = (a, b, lapse) => scaled(minus(b, a), 1 / lapse);
    const rootOf = (body) => Array.from(body.root);
    offsets.root = minus(rootOf(old.now), rootOf(next.now));
    offsets.rootSpeed = bounded(minus(
      speed(rootOf(old.now), rootOf(old.later), old.lapse), speed(rootOf(next.now), rootOf(next.later), next.lapse),
    ), FASTEST);
    for (let joint = 0; joint < this.joints; joint++) {
      const rates = [old, next].map(({ now, later, lapse }) => scaled(
        rotationVector(product(four(later.local, joint), conjugate(four(now.local, joint)))), 1 / lapse,
      ));
      offsets.turns.push(rotationVector(product(four(old.now.local, joint), conjugate(four(next.now.local, joint)))));
      offsets.turnSpeeds.push(bounded(minus(rates[0], rates[1]), FASTEST_TURN));
    }
    offsets.feet = [0, 1].map((k) => {
      const apart = product(was.turns[k], conjugate(is.turns[k])), ball = minus(was.balls[k], is.balls[k]);
      const yaw = 2 * Math.atan2((apart[0] < 0 ? -1 : 1) * apart[3], Math.abs(apart[0]));
      const stands = one.hold[k] > one.time;
      const ballSpeed = bounded(minus(
        speed(was.balls[k], wasLater.balls[k], old.lapse), speed(is.balls[k], isLater.balls[k], next.lapse),
      ), FASTEST);
      return {
        ball, yaw, tilt: rotationVector(product(apart, conjugate(aboutZ(yaw)))),
        ballSpeed: stands ? [0, 0, 0] : ballSpeed, hold: one.hold[k], end: one.end[k],
        rise: one.forced[k] ? Math.min(OWN_STEP * Math.hypot(ball[0], ball[1]), HIGHEST) : 0,
      };
    });
    return offsets;
  }

  /** Add what is left of a switch at a time to a body of the new motion. */
  faded(body, offsets, time) {
    const [keep, drift] = weights(Math.max(time - offsets.time, 0), FADE);
    const fresh = this.feet(body), places = this.places.slice();
    const targets = offsets.feet.map((foot, k) => this.footTarget(foot, fresh, places, k, time, keep));
    for (let axis = 0; axis < 3; axis++) body.root[axis] += keep * offsets.root[axis] + drift * offsets.rootSpeed[axis];
    for (let joint = 0; joint < this.joints; joint++) {
      const left = add(scaled(offsets.turns[joint], keep), offsets.turnSpeeds[joint], drift);
      body.local.set(product(turnOf(left), four(body.local, joint)), 4 * joint);
    }
    this.onFeet(body, places, targets);
  }

  footTarget(foot, fresh, places, k, time, keep) {
    const whole = foot.end - foot.hold, [share, drift] = weights(Math.max(time - foot.hold, 0), whole);
    const u = Math.min(Math.max((time - foot.hold) / whole, 0), 1), low = Math.min(share, keep);
    const moved = add(scaled(foot.ball, share), foot.ballSpeed, drift);
    // Heights and tilts are put right at once: no foot hangs over the floor.
    moved[2] = low * foot.ball[2] + foot.rise * 16 * u * u * (1 - u) * (1 - u);
    const turn = product(product(turnOf(scaled(foot.tilt, low)), aboutZ(share * foot.yaw)), fresh.turns[k]);
    // The foot turns about its ball.
    const back = minus(three(places, this.ankles[k]), fresh.balls[k]);
    const about = turned(product(turn, conjugate(fresh.turns[k])), back);
    return { ankle: add(add(fresh.balls[k], moved), about), turn };
  }

  /** Bend the legs to their targets; the pelvis comes down if one does not reach. */
  onFeet(body, before, targets) {
    this.forward(body);
    const { places, world } = this, hinge = turned(four(world, 0), [0, 1, 0]);
    let down = 0;
    const legs = this.legs.map(([hip, knee, ankle], k) => {
      const [h, n, a] = [hip, knee, ankle].map((joint) => three(places, joint));
      const whole = far(minus(n, h)) + far(minus(a, n));
      const alone = far(minus(three(before, ankle), three(before, hip)));
      const most = Math.max(alone / whole, far(minus(a, h)) / whole, REACH);
      const { ankle: target } = targets[k], reach = most * whole, x = h[0] - target[0], y = h[1] - target[1];
      down = Math.max(down, h[2] - target[2] - Math.sqrt(Math.max(reach * reach - x * x - y * y, 0.01)));
      return { h, n, a, most, thigh: four(world, hip), shank: four(world, knee) };
    });
    const parents = this.legs.map(([hip]) => four(world, this.bodies.parents[hip]));
    body.root[2] -= down;
    this.legs.forEach(([hip, knee, ankle], k) => {
      const leg = legs[k];
      for (const point of [leg.h, leg.n, leg.a]) point[2] -= down;
      const { thigh, shank } = bendLeg(leg, targets[k].ankle, hinge);
      body.local.set(product(conjugate(parents[k]), thigh), 4 * hip);
      body.local.set(product(conjugate(thigh), shank), 4 * knee);
      body.local.set(product(conjugate(shank), targets[k].turn), 4 * ankle);
    });
  }
}

/** World rotations of thigh and shank that bring an ankle to its target; crowdsim/motion/clips/leg_solver.py. */
export function bendLeg({ h, n, a, most, thigh, shank }, target, hinge) {
  const first = minus(n, h), second = minus(a, n), upper = far(first), lower = far(second);
  const way = minus(target, h);
  const reach = Math.min(Math.max(far(way), Math.abs(upper - lower) + 1e-3), most * (upper + lower));
  const cosine = (reach * reach - upper * upper - lower * lower) / (2 * upper * lower);
  const angle = Math.acos(Math.min(Math.max(cosine, -1), 1));
  const down = unit(first), along = unit(second), across = cross(down, along);
  // A straight leg does not tell where its knee bends, and one that is bent backwards is bent forward from now on.
  const bent = add(across, hinge, Math.max(BENT - dot(across, hinge), 0));
  const axis = unit(add(bent, down, -dot(bent, down)));
  const wanted = add(scaled(down, Math.cos(angle)), cross(axis, down), Math.sin(angle));
  const bend = shortest(along, wanted), turn = shortest(unit(add(first, wanted, lower)), unit(way));
  return { thigh: product(turn, thigh), shank: product(turn, product(bend, shank)) };
}

/** The short way from one unit vector to another. */
function shortest(a, b) {
  const c = cross(a, b), q = [1 + dot(a, b), c[0], c[1], c[2]], n = 1 / Math.hypot(...q);
  return q.map((value) => value * n);
}
