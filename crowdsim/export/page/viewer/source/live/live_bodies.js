// Bodies whose next steps are not known yet: footsteps are planned anew several times a second, and what changes fades.

import { difference, partThen } from "../quaternions.js";
import { Bodies, SteeredBodies } from "./viewer.js";

const PLAN_EVERY = 0.15; // seconds of the simulation
const PLANS = 30; // largest number of new plans for a picture; plans that are OLD are always made anew
const OLD = 0.6; // seconds
const REPLANNED = 0.25, SWITCHED = 0.35; // seconds over which a change fades
const FORGOTTEN = 0.5; // seconds after which a body that was not drawn begins anew

class LiveSteered extends SteeredBodies {
  constructor(source, models) {
    super(source, models);
    this.kept = new Map();
    this.forced = null;
    this.left = PLANS;
  }

  stretchAt(agent, step) {
    return this.source.stretchOf(agent, step);
  }

  /** The plan of an agent: of the track as it is known now, or a moment ago. */
  planAt(agent, stretch, step) {
    if (this.forced) return this.forced;
    const { rate } = this.source, kept = this.kept.get(agent), old = kept ? (this.source.latest - kept.made) / rate : Infinity;
    const same = kept && kept.first === stretch.first;
    if (same && (old < PLAN_EVERY || (this.left <= 0 && old < OLD) || kept.made === stretch.stop - 1)) return kept.plan;
    this.left -= 1;
    const plan = this.makePlan(agent, stretch, Math.floor((step * 10) / rate / 50));
    this.kept.set(agent, { plan, first: stretch.first, made: stretch.stop - 1 });
    return plan;
  }
}

export class LiveBodies extends Bodies {
  constructor(block, source) {
    super(block, source);
    this.steered = new LiveSteered(source, this.steered.models);
    this.shown = new Map();
    this.oldRoot = new Float64Array(3);
    this.oldLocal = new Float64Array(4 * this.joints);
  }

  /** Begin a picture, for which PLANS new plans may be made. */
  begin() {
    this.steered.left = PLANS;
  }

  pose(agent, frame) {
    if (!frame.state[agent]) {
      this.shown.delete(agent);
      return false;
    }
    const { step, time } = frame, stretch = this.steered.stretchAt(agent, step);
    let key = "captured";
    if (stretch) {
      this.steered.pose(agent, stretch, time, step, this.root, this.local);
      key = this.steered.kept.get(agent).plan;
    } else if (frame.node[agent] >= 0) {
      this.nodes.pose(
        frame.node[agent], frame.previous[agent], frame.frame[agent],
        frame.x[agent], frame.y[agent], frame.heading[agent], this.root, this.local,
      );
    } else return false;
    let last = this.shown.get(agent);
    if (last && Math.abs(time - last.time) > FORGOTTEN) last = undefined;
    if (!last) {
      last = { offset: new Float64Array(3), turns: new Float64Array(4 * this.joints), root: new Float64Array(3), local: new Float64Array(4 * this.joints), until: -1, whole: 1 };
      this.shown.set(agent, last);
    } else if (last.key !== key) this.change(agent, frame, stretch, last, key);
    last.key = key;
    last.time = time;
    last.x = frame.x[agent];
    last.y = frame.y[agent];
    this.fade(last, time, this.root, this.local);
    last.root.set(this.root);
    last.local.set(this.local);
    this.forward();
    return true;
  }

  /** Keep the jump that a change of the plan, or of the kind of motion, would cause, as an offset that fades. */
  change(agent, frame, stretch, last, key) {
    const { oldRoot, oldLocal } = this, { time, step } = frame;
    const replanned = stretch && last.key !== "captured";
    if (replanned) {
      this.steered.forced = last.key;
      this.steered.pose(agent, stretch, time, step, oldRoot, oldLocal);
      this.steered.forced = null;
      this.fade(last, time, oldRoot, oldLocal);
    } else {
      oldRoot.set(last.root);
      oldRoot[0] += frame.x[agent] - last.x;
      oldRoot[1] += frame.y[agent] - last.y;
      oldLocal.set(last.local);
    }
    for (let k = 0; k < 3; k++) last.offset[k] = oldRoot[k] - this.root[k];
    for (let joint = 0; joint < this.joints; joint++) difference(last.turns, 4 * joint, oldLocal, 4 * joint, this.local, 4 * joint);
    last.whole = replanned ? REPLANNED : SWITCHED;
    last.until = time + last.whole;
  }

  fade(last, time, root, local) {
    const left = Math.min((last.until - time) / last.whole, 1);
    if (left <= 0) return;
    const share = left * left * (3 - 2 * left);
    for (let k = 0; k < 3; k++) root[k] += share * last.offset[k];
    for (let joint = 0; joint < this.joints; joint++) partThen(local, 4 * joint, last.turns, 4 * joint, share, local, 4 * joint);
  }
}
