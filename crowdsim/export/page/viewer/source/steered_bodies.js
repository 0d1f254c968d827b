// Bodies of steered agents: footsteps are planned for blocks of five seconds of their smoothed tracks, as in
// crowdsim/recording/shown/steered_poses.py and track_blocks.py.

import { poseBody, poseUpper } from "./deformed.js";
import { planSteps } from "./footsteps.js";
import { shorterWay } from "./step_tracks.js";
import { wrapAngle } from "./quaternions.js";

const TICKS = 10; // samples a second
const BLOCK = 50, BEFORE = 45, AFTER = 45, FARTHEST = 720; // ticks
const CYCLES = 2.25, SPARE = 5, OF_A_STAND = 15;
const SMOOTHED = 0.85, REACH = 4; // seconds, and samples on both sides
const BLEND = 0.3; // seconds over which a body changes from one behavior to another
const KEPT = 1500; // plans that are kept, each of one stretch in one block

const WINDOW = Array.from({ length: REACH + 1 }, (_, k) => 0.5 + 0.5 * Math.cos((2 * Math.PI * k) / (TICKS * SMOOTHED)));

export class SteeredBodies {
  constructor(source, models) {
    this.source = source;
    this.models = models;
    this.walk = models[models.length - 1];
    this.plans = new Map();
    this.track = new Float64Array(4);
    this.other = new Float64Array(4 * (this.walk ? this.walk.shapes.mean[0] : 1));
    this.weights = new Float64Array(models.length);
  }

  /** The stretch in which an agent is shown as steered at a step; null if it is not. */
  stretchAt(agent, step) {
    for (const stretch of this.source.stretches[agent]) {
      if (stretch.first <= step && step < stretch.end) return stretch;
    }
    return null;
  }

  /** Pose of an agent in a stretch, at a time [s] from `step` to the next one: root into `root`, local rotations into `out`. */
  pose(agent, stretch, time, step, root, out) {
    const { ends } = this.source.facts;
    const plan = this.planAt(agent, stretch, Math.min(Math.max(step, stretch.first), stretch.end - 1));
    const weights = this.behaviorWeights(agent, stretch, time);
    let done = 0, track = null;
    for (let behavior = 0; behavior < weights.length; behavior++) {
      if (weights[behavior] <= 0) continue;
      const model = this.models[behavior];
      done += weights[behavior];
      if (track === null) {
        track = poseBody(model, plan, time - plan.zero, root, out);
        continue;
      }
      // All behaviors walk on the same legs: only the joints above them differ.
      poseUpper(model, track, this.other);
      for (const joint of model.upper) slerpInto(out, 4 * joint, this.other, weights[behavior] / done);
    }
    if (ends) {
      const span = ends[2] - ends[1];
      root[ends[0]] -= Math.floor((root[ends[0]] - ends[1]) / span) * span;
    }
  }

  /** Weight of each behavior at a time [s]: the recorded ones, smoothed over BLEND seconds; their sum is 1. */
  behaviorWeights(agent, stretch, time) {
    const { source, weights } = this;
    const half = 0.5 * BLEND, rate = source.rate;
    const first = Math.floor((time - half) * rate), last = Math.floor((time + half) * rate);
    weights.fill(0);
    let before = 0;
    for (let step = first; step <= last; step++) {
      const u = Math.min(Math.max((((step + 1) / rate - time) / half + 1) / 2, 0), 1);
      const reached = step === last ? 1 : u * u * (3 - 2 * u);
      const row = Math.min(Math.max(step, stretch.first), stretch.end - 1);
      weights[source.eventBehavior[source.eventAt(agent, row)]] += reached - before;
      before = reached;
    }
    return weights;
  }

  /** The plan of a stretch in the block of a step; it is made if it is not kept. */
  planAt(agent, stretch, step) {
    const block = Math.floor(Math.floor((step * TICKS) / this.source.rate) / BLOCK);
    const key = `${agent}/${stretch.first}/${block}`;
    let plan = this.plans.get(key);
    if (plan === undefined) {
      if (this.plans.size >= KEPT) this.plans.delete(this.plans.keys().next().value);
      plan = this.makePlan(agent, stretch, block);
      this.plans.set(key, plan);
    }
    return plan;
  }

  /** Plan a stretch in a block: read twice as far back until the track holds all that its poses depend on. */
  makePlan(agent, stretch, block) {
    for (let before = BEFORE; ; before *= 2) {
      const { track, rows, zero, lacks } = this.readTrack(agent, stretch, block, before);
      if (lacks && before < FARTHEST) continue;
      return Object.assign(planSteps(this.walk, track, rows), { zero });
    }
  }

  /** Smoothed samples of a stretch around a block, as crowdsim/recording/shown/track_blocks.py reads them. */
  readTrack(agent, stretch, block, before) {
    const { rate } = this.source, low = block * BLOCK - before, high = (block + 1) * BLOCK + AFTER;
    const firstRow = Math.max(Math.floor((low * rate) / TICKS), 0);
    const endRow = Math.min(Math.ceil((high * rate) / TICKS) + 1, this.source.steps);
    const begin = Math.max(stretch.begin, firstRow), stop = Math.min(stretch.stop, endRow);
    const cutBefore = stretch.begin < firstRow, cutAfter = stretch.stop > endRow;
    const firstTick = Math.max(Math.floor((begin * TICKS) / rate), low);
    const lastTick = Math.min(Math.ceil(((stop - 1) * TICKS) / rate), high);
    const count = lastTick - firstTick + 1;
    const raw = this.sampleTicks(agent, stretch, firstTick, count, begin, stop);
    const smooth = smoothed(raw, count);
    // Keep what the poses of the block depend on.
    const phase = (k) => smooth[4 * k + 3];
    const clamp = (k) => Math.min(Math.max(k, 0), count - 1);
    const atFirst = phase(clamp(block * BLOCK - firstTick)), atEnd = phase(clamp((block + 1) * BLOCK - firstTick));
    let earlier = 0, beforeEnd = 0;
    for (let k = 0; k < count; k++) {
      if (phase(k) <= atFirst - CYCLES) earlier += 1;
      if (phase(k) < atEnd + CYCLES) beforeEnd += 1;
    }
    const lacks = cutBefore && earlier <= REACH + SPARE;
    const from = Math.max(earlier - 1 - SPARE, cutBefore ? REACH : 0);
    const to = Math.min(beforeEnd + SPARE, count - (cutAfter ? REACH : 0));
    const kept = [];
    for (let k = Math.max(from, 0); k < to; k++) {
      const inside = k >= OF_A_STAND && k + OF_A_STAND < count;
      const stands = inside && phase(k) === phase(k - OF_A_STAND) && phase(k) === phase(k + OF_A_STAND);
      if (stands && firstTick + k < block * BLOCK - OF_A_STAND) continue;
      kept.push(k);
    }
    const track = new Float64Array(4 * kept.length);
    kept.forEach((k, row) => track.set(smooth.subarray(4 * k, 4 * k + 4), 4 * row));
    const zero = (firstTick + kept[kept.length - 1] - kept.length + 1) / TICKS;
    return { track, rows: kept.length, zero, lacks };
  }

  /**
   * Track (x, y, heading, phase) of `count` ticks from `firstTick` on, interpolated between the steps from `begin` to
   * before `stop`.
   */
  sampleTicks(agent, stretch, firstTick, count, begin, stop) {
    const { rate, facts } = this.source;
    const raw = new Float64Array(4 * count), now = this.track, then = new Float64Array(4);
    const between = [0, 0, 0];
    for (let k = 0; k < count; k++) {
      const place = (firstTick + k) * rate, row = Math.floor(place / TICKS), share = (place - row * TICKS) / TICKS;
      const a = Math.min(Math.max(row, begin), stop - 1), b = Math.min(Math.max(row + 1, begin), stop - 1);
      refine(this.source.trackAt(agent, a, now), stretch, a);
      refine(this.source.trackAt(agent, b, then), stretch, b);
      for (let axis = 0; axis < 3; axis++) {
        let way = then[axis] - now[axis];
        if (axis === 2) way = wrapAngle(way);
        else if (facts.ends && facts.ends[0] === axis) way = shorterWay(way, facts.ends[2] - facts.ends[1]);
        between[axis] = now[axis] + share * way;
      }
      // Without jumps: neither at the ends of a floor nor of a turn.
      for (let axis = 0; axis < 3; axis++) {
        let value = between[axis];
        if (k > 0) {
          const old = raw[4 * (k - 1) + axis];
          if (axis === 2) value = old + wrapAngle(value - old);
          else if (facts.ends && facts.ends[0] === axis) value = old + shorterWay(value - old, facts.ends[2] - facts.ends[1]);
        }
        raw[4 * k + axis] = value;
      }
      const p = (row) => stretch.phases[row - stretch.begin] + exactly(stretch, row, 3);
      raw[4 * k + 3] = p(a) + share * (p(b) - p(a));
    }
    return raw;
  }
}

/** What is missing from whole units in a stretch's last steps: of x, y (0, 1) [m], heading (2) [rad] and phase (3); else 0. */
function exactly(stretch, row, column) {
  return stretch.exact[4 * (stretch.stop - 1 - row) + column] ?? 0;
}

/** Make a track pose [x, y, heading] exact, as bodies are extrapolated from the last ones of a stretch. */
function refine(place, stretch, row) {
  for (let axis = 0; axis < 3; axis++) place[axis] += exactly(stretch, row, axis);
}

/** Samples (4 each) smoothed by a Hann window that shrinks at the ends of the track; phases stay as they are. */
function smoothed(raw, count) {
  const out = raw.slice();
  for (let k = 0; k < count; k++) {
    const near = Math.min(k, count - 1 - k, REACH);
    for (let axis = 0; axis < 3; axis++) {
      let total = 0, norm = 0;
      for (let off = -near; off <= near; off++) {
        const weight = WINDOW[Math.abs(off)];
        total += weight * raw[4 * (k + off) + axis];
        norm += weight;
      }
      out[4 * k + axis] = total / norm;
    }
  }
  return out;
}

/** Rotate the quaternion a[i..] towards b[i..] by a share of the way, in place. */
function slerpInto(a, i, b, share) {
  let dot = a[i] * b[i] + a[i + 1] * b[i + 1] + a[i + 2] * b[i + 2] + a[i + 3] * b[i + 3];
  const sign = dot < 0 ? -1 : 1;
  dot = Math.min(Math.abs(dot), 1);
  const angle = Math.acos(dot), sine = Math.sin(angle);
  const p = sine < 1e-6 ? 1 - share : Math.sin((1 - share) * angle) / sine;
  const q = sign * (sine < 1e-6 ? share : Math.sin(share * angle) / sine);
  for (let c = 0; c < 4; c++) a[i + c] = p * a[i + c] + q * b[i + c];
}

/** Models of all gaits of a page. */
export function readGaits(block) {
  return block.facts.gaits.map((facts, number) => {
    const model = { ...facts };
    for (const name of Object.keys(facts.shapes)) model[name] = block.array(`gait_${number}_${name}`);
    return model;
  });
}
