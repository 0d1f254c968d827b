// Feet of captured bodies from step to step: crowdsim/motion/planted/follow_kernels.py in JavaScript. The page has the
// feet in the first step of each chunk. A foot that lands stands where it is posed, whatever was before: its displacement
// has faded by then, if it began to fade a frame earlier or more.

import { splitStep } from "./step_tracks.js";
import { Varints } from "./unpack.js";
import { wrapAngle } from "./quaternions.js";

export const FREE = 0, STANDS = 1, FADES = 2; // modes
const LONGEST_FADE = 24; // frames
const FOLLOWED_ON = 64; // largest number of steps over which feet are followed on from the step requested last
const NOTHING = 1e-9;
// In the order of packed_feet.py.
const COLUMNS = ["modes", "since", "fading", "x", "y", "yaws"];
const UNKNOWN = { mode: FREE, node: -1, since: 0, until: 0, pose: [0, 0, 0] };

export class FollowedFeet {
  constructor(feet, block) {
    this.feet = feet;
    this.bodies = feet.bodies;
    this.stands = block.array("feet_stands");
    this.root = new Float64Array(3);
    this.local = new Float64Array(4 * this.bodies.joints);
    this.known = new Map(); // by agent: a step, and all changes from it to the next
    this.readFirst(block);
  }

  /** Feet in the first step of each chunk, by chunk and agent; the pose of a standing foot is relative to the posed one. */
  readFirst(block) {
    const { source } = this.bodies, { chunk, feet: units } = block.facts;
    const columns = COLUMNS.map((name) => new Varints(block.array(`feet_${name}`)));
    const [modes, begins, fading, x, y, yaws] = columns;
    this.first = [];
    for (let step = 0; step < source.steps; step += chunk) {
      const byAgent = new Map();
      for (let agent = 0; agent < source.count; agent++) {
        const node = source.eventNode[source.eventAt(agent, step)];
        if (node < 0) continue;
        byAgent.set(agent, [0, 1].map(() => {
          const mode = modes.next(), since = begins.next() / units.frame, until = since + fading.next() / units.frame;
          return { mode, node, since, until, pose: [x.signed() / units.place, y.signed() / units.place, yaws.signed() / units.angle] };
        }));
      }
      this.first.push(byAgent);
    }
  }

  /** What an agent plays in a step: node (-1 for none), node before, and its track and frame in the chunk. */
  played(chunk, agent, step) {
    const { source } = this.bodies, e = source.eventAt(agent, step), i = agent * chunk.span + step - chunk.low;
    return {
      node: source.eventNode[e], previous: source.eventPrevious[e],
      frame: chunk.frame[i], track: [chunk.x[i], chunk.y[i], chunk.heading[i]],
    };
  }

  /**
   * What an agent plays in a step (`old`) and in the next one (`now`), and on the way: one or two `parts` of nodes,
   * frames `begin` to `end` between shares `early` and `late` of the step; null if it is not captured in both.
   */
  partsFrom(agent, step) {
    const { source, nodes } = this.bodies, chunk = source.chunkOf(step);
    const old = this.played(chunk, agent, step), now = this.played(chunk, agent, step + 1);
    const found = { old, now, parts: null };
    if (old.node < 0 || now.node < 0) return found;
    if (old.node === now.node && now.frame >= old.frame) {
      found.parts = [partOf(old, old.frame, now.frame, 0, 1)];
      return found;
    }
    const { part, end, begin } = splitStep(nodes.frames[old.node], old.frame, now.frame, source.stepTracks.natural);
    found.parts = [partOf(old, old.frame, end, 0, part), partOf(now, begin, now.frame, part, 1)];
    return found;
  }

  /** Frames of a part in which a foot lands or lifts, in order: calls `then(frame, foot, stands)`. */
  eachChange({ node, begin, end }, then) {
    const { nodes } = this.bodies, first = nodes.first[node];
    for (let frame = Math.floor(begin) + 1; frame <= Math.min(Math.floor(end), nodes.frames[node] - 1); frame++) {
      const stood = this.stands[first + frame - 1], stands = this.stands[first + frame];
      for (let foot = 0; foot < 2; foot++) {
        if ((stood ^ stands) & (1 << foot)) then(frame, foot, (stands >> foot) & 1);
      }
    }
  }

  /** The step from which feet are followed up to `step`, and their states there. */
  begin(agent, step) {
    const { source } = this.bodies, length = source.facts.chunk, number = Math.floor(step / length);
    const landed = [false, false];
    for (let from = step; from > number * length; from--) {
      const { old, parts } = this.partsFrom(agent, from - 1);
      if (old.node < 0) return [from, this.asPosed(agent, from)];
      for (const part of parts) {
        this.eachChange(part, (frame, foot, stands) => (landed[foot] ||= stands > 0 && frame - part.begin >= 1));
      }
      if (landed[0] && landed[1]) return [from - 1, [UNKNOWN, UNKNOWN]];
    }
    const now = this.played(source.chunkOf(step), agent, number * length);
    const states = this.first[number].get(agent).map((state) => ({ ...state }));
    this.pose(now, now.frame, now.track);
    states.forEach((state, foot) => {
      if (state.mode !== STANDS) return;
      state.since = now.frame;
      state.pose = this.feet.placeOf(foot).map((value, k) => value + state.pose[k]);
    });
    return [number * length, states];
  }

  /** All changes of both feet from a step to the next, each with its share of the step; the first ones hold at the step. */
  changesFrom(agent, step) {
    let known = this.known.get(agent);
    if (known && known.step === step) return known.changes;
    let from, states;
    if (known && known.step < step && step - known.step <= FOLLOWED_ON && this.isCaptured(agent, known.step, step)) {
      from = known.step + 1;
      states = known.changes.map((all) => all[all.length - 1]);
    } else [from, states] = this.begin(agent, step);
    for (; from < step; from++) states = this.follow(agent, from, states).map((all) => all[all.length - 1]);
    known = { step, changes: this.follow(agent, step, states) };
    this.known.set(agent, known);
    return known.changes;
  }

  /** Whether an agent is captured in all steps from one to another. */
  isCaptured(agent, first, last) {
    const { source } = this.bodies;
    for (let e = source.eventAt(agent, first); e < source.firstEvent[agent + 1] && source.eventStep[e] <= last; e++) {
      if (source.eventNode[e] < 0) return false;
    }
    return true;
  }

  /** Changes from a step to the next. */
  follow(agent, step, states) {
    const changes = states.map((state) => [{ ...state, share: 0 }]);
    const { source } = this.bodies;
    if (step + 1 >= source.steps) return changes;
    const { old, now, parts } = this.partsFrom(agent, step);
    if (!parts) return changes;
    const trackAt = (share) => source.stepTracks.between(old, now, share);
    this.play(parts[0], trackAt, changes);
    if (parts.length > 1) {
      const [{ node, end, late }, second] = parts;
      this.pose(parts[0], end, trackAt(late));
      const shown = [0, 1].map((foot) => {
        const place = this.feet.placeOf(foot);
        const moved = this.feet.correction(changes[foot][changes[foot].length - 1], foot, node, end, place);
        return place.map((value, k) => value + moved[k]);
      });
      this.enter(second, trackAt(late), shown, changes);
      this.play(second, trackAt, changes);
    }
    return changes;
  }

  /** Go on in the next node: a foot that stands keeps its place; the displacement of one that swings fades. */
  enter(part, track, shown, changes) {
    const { node, begin, early } = part, row = this.bodies.nodes.first[node] + Math.floor(begin);
    this.pose(part, begin, track);
    for (let foot = 0; foot < 2; foot++) {
      if ((this.stands[row] >> foot) & 1) {
        changes[foot].push({ share: early, mode: STANDS, node, since: begin, until: 0, pose: shown[foot] });
        continue;
      }
      const place = this.feet.placeOf(foot), [x, y] = [0, 1].map((k) => this.bodies.source.stepTracks.shorter(shown[foot][k] - place[k], k));
      changes[foot].push(this.released(node, begin, foot, [x, y, wrapAngle(shown[foot][2] - place[2])], early));
    }
  }

  /** Note each foot that lands or lifts in a part. */
  play(part, trackAt, changes) {
    const { node, begin, end, early, late } = part;
    this.eachChange(part, (frame, foot, stands) => {
      const share = early + ((late - early) * (frame - begin)) / Math.max(end - begin, 1e-9);
      this.pose(part, frame, trackAt(share));
      const place = this.feet.placeOf(foot), all = changes[foot], last = all[all.length - 1];
      const moved = this.feet.correction(last, foot, node, frame, place);
      if (stands) {
        const pose = place.map((value, k) => value + moved[k]);
        all.push({ share, mode: STANDS, node, since: frame, until: 0, pose });
      } else all.push(this.released(node, frame, foot, moved, share));
    });
  }

  /** State of a foot that lifts: its displacement `moved` (x, y, turn) fades until it lands, for LONGEST_FADE frames at most. */
  released(node, frame, foot, moved, share) {
    const { nodes } = this.bodies, first = nodes.first[node], last = nodes.frames[node];
    const stands = (at) => (this.stands[first + at] >> foot) & 1;
    let landing = Math.floor(frame) + 1;
    while (landing < last && !(stands(landing) && !stands(landing - 1))) landing += 1;
    const until = Math.min(landing < last ? landing : Infinity, frame + LONGEST_FADE);
    const mode = Math.abs(moved[0]) + Math.abs(moved[1]) + Math.abs(moved[2]) < NOTHING ? FREE : FADES;
    return { share, mode, node, since: frame, until, pose: moved };
  }

  /** Feet of a body that has just come, as its clip has them. */
  asPosed(agent, step) {
    const now = this.played(this.bodies.source.chunkOf(step), agent, step);
    const row = this.bodies.nodes.first[now.node] + Math.floor(now.frame);
    this.pose(now, now.frame, now.track);
    return [0, 1].map((foot) => {
      const mode = (this.stands[row] >> foot) & 1 ? STANDS : FREE;
      return { mode, node: now.node, since: now.frame, until: 0, pose: this.feet.placeOf(foot) };
    });
  }

  /** Pose a body in a frame of its node; its feet are then those of `feet.placeOf`. */
  pose({ node, previous }, frame, [x, y, heading]) {
    const { bodies, root, local } = this;
    bodies.nodes.pose(node, previous, frame, x, y, heading, root, local);
    bodies.place(root, local, this.feet.positions, this.feet.world);
  }
}

/** Frames of a node that are played between two shares of a step. */
function partOf({ node, previous }, begin, end, early, late) {
  return { node, previous, begin, end, early, late };
}
