// Bodies after a switch between captured and steered: the new motion, and what is left of the old one.
// crowdsim/recording/shown/switch_offsets.py, switch_blends.py and motion/clips/leg_solver.py in JavaScript.

import { conjugate, product, rotate } from "./quaternions.js";
import { REACH } from "./body_parts.js";
import { varints } from "./unpack.js";

const FADE = 0.4; // seconds
const LONGEST = 5.5; // seconds after which both feet have lost their offsets
const FASTEST = 1.5, FASTEST_TURN = 8; // largest velocities of an offset [m/s], [rad/s]
const OWN_STEP = 1.5, HIGHEST = 0.05, BENT = 0.05;
const RISES = 0.5, PASSED = 0.1, SHORT_FOOT = 0.02;
const LAPSE = 1 / 60; // seconds
const SIDES = ["left", "right"];
const COLUMNS = ["node", "previous", "frame", "x", "y", "heading", "state", "steered", "behavior", "speed"];

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

/** Rotation vector of a quaternion [rad]. */
function rotationVector(q) {
  const sign = q[0] < 0 ? -1 : 1, sine = Math.hypot(q[1], q[2], q[3]);
  const scale = sign * (sine < 1e-9 ? 2 : (2 * Math.atan2(sine, sign * q[0])) / sine);
  return [scale * q[1], scale * q[2], scale * q[3]];
}

/** Quaternion of a rotation vector [rad]. */
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

  /** Read the switches of each agent: see pack_switches of packed_poses.py. */
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

  /** Change a pose of the new motion, in place, to the one that is shown at a time [s] from `step` to the next one. */
  apply(agent, time, step, root, local) {
    const all = this.byAgent.get(agent);
    if (!all) return;
    let last = -1;
    while (last + 1 < all.length && all[last + 1].step <= step) last += 1;
    if (last < 0 || time >= all[last].until) return;
    const kept = { root: root.slice(), local: local.slice() };
    this.faded({ root, local }, this.offsetsOf(agent, all, last, kept), time);
  }

  /** The offsets of a switch, measured at the first call. */
  offsetsOf(agent, all, number, kept) {
    const one = all[number];
    if (one.offsets) return one.offsets;
    const { steered } = this.bodies;
    const captured = this.playedAt(agent, one);
    const walk = (time, step) => {
      const body = this.newBody();
      steered.pose(agent, steered.stretchAt(agent, step), time, step, body.root, body.local);
      return body;
    };
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

  /**
   * A captured body at its switch, and a frame later. A frame earlier if it was captured in the step before, and either is
   * the old motion or is in the last step.
   */
  playedAt(agent, one) {
    const { source } = this.bodies, { step, time } = one;
    const e = step > 0 ? source.eventAt(agent, step - 1) : -1;
    const captured = e >= 0 && (source.eventState[e] & 3) > 0 && source.eventNode[e] >= 0;
    const isLast = step + 1 === source.steps, way = captured && (one.toSteered || isLast) ? -LAPSE : LAPSE;
    // If the page's last step is its only captured one, the body does not move.
    const later = isLast && !captured ? time : time + way;
    return { now: this.played(agent, time), later: this.played(agent, later), lapse: way };
  }

  /** A captured body at a time [s], on its planted feet. */
  played(agent, time) {
    const { source, nodes } = this.bodies, place = time * source.rate, step = Math.floor(place + 1e-6);
    const one = Object.fromEntries(COLUMNS.map((name) => [name, {}])), body = this.newBody();
    const share = place - step;
    source.between(source.chunkOf(step), agent, step, share < 1e-6 ? 0 : share, one);
    const [node, previous, frame, x, y, heading] = COLUMNS.map((name) => one[name][agent]);
    nodes.pose(node, previous, frame, x, y, heading, body.root, body.local);
    this.bodies.feet.pin(agent, time, node, frame, body.root, body.local);
    return body;
  }

  forward(body) {
    this.bodies.place(body.root, body.local, this.places, this.world);
  }

  /** Balls and world rotations of both feet of a body. */
  feet(body) {
    this.forward(body);
    return { balls: this.toes.map((toe) => three(this.places, toe)), turns: this.ankles.map((ankle) => four(this.world, ankle)) };
  }

  /** Differences of an old motion to the next one at a switch. */
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

  /**
   * Ball, rotation and ankle of foot `k` with its offset at a time; `keep` is the share of the body's offset that is
   * left.
   */
  footTarget(foot, fresh, places, k, time, keep) {
    const whole = foot.end - foot.hold, [share, drift] = weights(Math.max(time - foot.hold, 0), whole);
    const u = Math.min(Math.max((time - foot.hold) / whole, 0), 1), low = Math.min(share, keep);
    const moved = add(scaled(foot.ball, share), foot.ballSpeed, drift);
    // Heights and tilts fade from the switch on, even of planted feet, so that no foot hovers.
    moved[2] = low * foot.ball[2] + foot.rise * 16 * u * u * (1 - u) * (1 - u);
    const turn = product(product(turnOf(scaled(foot.tilt, low)), aboutZ(share * foot.yaw)), fresh.turns[k]);
    // The foot turns about its ball.
    const back = minus(three(places, this.ankles[k]), fresh.balls[k]);
    const about = turned(product(turn, conjugate(fresh.turns[k])), back), ball = add(fresh.balls[k], moved);
    return { ankle: add(ball, about), ball, turn };
  }

  /** Bend the legs to their targets; the heel of one that does not reach rises, then the pelvis comes down. */
  onFeet(body, before, targets) {
    this.forward(body);
    const { places, world } = this, hinge = turned(four(world, 0), [0, 1, 0]);
    let down = 0;
    const legs = this.legs.map(([hip, knee, foot], k) => {
      const [h, n, a] = [hip, knee, foot].map((joint) => three(places, joint));
      const whole = far(minus(n, h)) + far(minus(a, n));
      const alone = far(minus(three(before, foot), three(before, hip)));
      const most = Math.max(alone / whole, far(minus(a, h)) / whole, REACH);
      const { ankle, ball } = targets[k], reach = most * whole, rise = raisedHeel(h, ball, ankle, reach);
      const target = add(ball, turned(rise, minus(ankle, ball))), x = h[0] - target[0], y = h[1] - target[1];
      down = Math.max(down, h[2] - target[2] - Math.sqrt(Math.max(reach * reach - x * x - y * y, 0.01)));
      return { h, n, a, most, target, rise, thigh: four(world, hip), shank: four(world, knee) };
    });
    const parents = this.legs.map(([hip]) => four(world, this.bodies.parents[hip]));
    body.root[2] -= down;
    this.legs.forEach(([hip, knee, ankle], k) => {
      const leg = legs[k];
      for (const point of [leg.h, leg.n, leg.a]) point[2] -= down;
      const { thigh, shank } = bendLeg(leg, leg.target, hinge), turn = product(leg.rise, targets[k].turn);
      body.local.set(product(conjugate(parents[k]), thigh), 4 * hip);
      body.local.set(product(conjugate(thigh), shank), 4 * knee);
      body.local.set(product(conjugate(shank), turn), 4 * ankle);
      // Toes keep their direction in the world as the heel rises.
      const toe = this.toes[k], kept = product(conjugate(turn), targets[k].turn);
      if (this.bodies.parents[toe] === ankle) body.local.set(product(kept, four(body.local, toe)), 4 * toe);
    });
  }
}

/** The turn about the ball by which a heel rises so that its leg reaches the ankle, if the hip has passed the ball. */
function raisedHeel(hip, ball, ankle, reach) {
  const foot = minus(ball, ankle), from = minus(hip, ball), ahead = unit([foot[0], foot[1], 0]), radius = far(foot);
  if (far(minus(hip, ankle)) <= reach || radius <= SHORT_FOOT) return [1, 0, 0, 0];
  // Law of cosines in the triangle of ball, ankle and hip.
  const x = dot(from, ahead), z = from[2], square = dot(from, from) + radius * radius - reach * reach;
  const share = Math.min(Math.max(square / (2 * radius * Math.max(Math.hypot(x, z), 1e-9)), -1), 1);
  const angle = Math.atan2(z, x) + Math.acos(share) - Math.atan2(-foot[2], -dot(foot, ahead));
  const turn = Math.min(Math.max(angle, -RISES), 0) * Math.min(Math.max(x / PASSED, 0), 1);
  return [Math.cos(turn / 2), Math.sin(turn / 2) * ahead[1], -Math.sin(turn / 2) * ahead[0], 0];
}

/** World rotations of thigh and shank that bring an ankle to its target; crowdsim/motion/clips/leg_solver.py. */
export function bendLeg({ h, n, a, most, thigh, shank }, target, hinge) {
  const first = minus(n, h), second = minus(a, n), upper = far(first), lower = far(second);
  const way = minus(target, h);
  const reach = Math.min(Math.max(far(way), Math.abs(upper - lower) + 1e-3), most * (upper + lower));
  const cosine = (reach * reach - upper * upper - lower * lower) / (2 * upper * lower);
  const angle = Math.acos(Math.min(Math.max(cosine, -1), 1));
  const down = unit(first), along = unit(second), across = cross(down, along);
  // A straight leg does not give the axis of its knee: the hinge does. A leg that is bent backwards is bent forward from now on.
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
