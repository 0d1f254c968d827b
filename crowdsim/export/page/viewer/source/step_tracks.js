// Tracks of captured bodies between two steps: crowdsim/motion/planted/between_kernels.py in JavaScript.

import { blendWeight } from "./node_tracks.js";
import { wrapAngle } from "./quaternions.js";

const CAPTURE_RATE = 60;
const UNITS = 10000; // of meters and radians, of tracks of nodes
const NOTHING = 1e-9, MOST_WHOLE = 20;

/**
 * How a step is divided between two nodes of which the first one ends in it: the first is played up to frame `end`,
 * until `part` of the step, the next one from `begin` on. An agent that leaves an idle node skips the rest of it: the next
 * node is played from its begin, and the idle node goes on until then. Only who enters a node in its middle has more frames
 * of it behind it than a step has.
 */
export function splitStep(last, since, frame, natural) {
  const advance = last - since + frame;
  if (2 * advance <= 3 * natural) return { part: advance > 0 ? (last - since) / advance : 1, end: last, begin: 0 };
  const part = Math.max(1 - frame / natural, 0);
  return { part, end: Math.min(since + part * natural, last), begin: 2 * frame <= 3 * natural ? 0 : frame - natural };
}

/** A displacement along an axis, taken across the ends of a floor of length `span` if that is shorter [m]. */
export function shorterWay(way, span) {
  return way - span * Math.round(way / span);
}

export class StepTracks {
  /** `nodes`: the NodeTracks of a page. `ends`: axis, low and high end of a periodic floor, or null. */
  constructor(nodes, rate, ends) {
    this.nodes = nodes;
    this.natural = CAPTURE_RATE / rate;
    this.spans = [0, 0];
    if (ends) this.spans[ends[0]] = ends[2] - ends[1];
    this.told = nodes.rows.some((value) => value !== 0); // older recordings hold no tracks of nodes
  }

  /** A displacement along an axis, taken across the ends of a periodic floor if that is shorter [m]. */
  shorter(way, axis) {
    const span = this.spans[axis];
    return span ? shorterWay(way, span) : way;
  }

  /**
   * Track pose at a share of the step from `old` to `now`, each with the node that it plays (-1 for none), its frame and
   * the track pose. A body without a node in one of them goes straight.
   */
  between(old, now, share) {
    if (share >= 1) return now.track;
    const same = old.node === now.node && now.frame >= old.frame;
    if (!this.told || old.node < 0 || now.node < 0 || (same && now.frame - old.frame < NOTHING)) {
      const [x, y] = [0, 1].map((k) => old.track[k] + share * this.shorter(now.track[k] - old.track[k], k));
      return [x, y, old.track[2] + share * wrapAngle(now.track[2] - old.track[2])];
    }
    if (same) {
      const frame = old.frame + share * (now.frame - old.frame);
      return this.alongNode(now.node, old.frame, old.track, now.frame, now.track, frame);
    }
    const { part, end, begin } = splitStep(this.nodes.frames[old.node], old.frame, now.frame, this.natural);
    if (share < part) return this.beyond(old, old.frame + ((end - old.frame) * share) / part);
    const frame = begin + ((now.frame - begin) * (share - part)) / Math.max(1 - part, NOTHING);
    return this.alongNode(now.node, begin, this.beyond(old, end), now.frame, now.track, frame);
  }

  /** Track pose of a node in a frame, relative to its first one. */
  inClip(node, frame) {
    const { first, frames, rows } = this.nodes, last = first[node] + frames[node];
    const row = Math.min(first[node] + Math.floor(frame), last), after = Math.min(row + 1, last);
    const part = frame - Math.floor(frame), a = 3 * row, b = 3 * after;
    const [x, y] = [0, 1].map((k) => (rows[a + k] + part * (rows[b + k] - rows[a + k])) / UNITS);
    return [x, y, rows[a + 2] / UNITS + part * wrapAngle((rows[b + 2] - rows[a + 2]) / UNITS)];
  }

  /** Pose in a frame of a body that goes on along its node. */
  beyond({ node, frame, track }, end) {
    const [ax, ay, ah] = this.inClip(node, frame), [bx, by, bh] = this.inClip(node, end);
    const c = Math.cos(track[2] - ah), s = Math.sin(track[2] - ah), x = bx - ax, y = by - ay;
    return [track[0] + c * x - s * y, track[1] + s * x + c * y, track[2] + wrapAngle(bh - ah)];
  }

  /** Pose in a frame of a body that is at `start` in frame `begin` and at `goal` in frame `end` of a node. */
  alongNode(node, begin, start, end, goal, frame) {
    const [ax, ay, ah] = this.inClip(node, begin), [bx, by, bh] = this.inClip(node, end), p = this.inClip(node, frame);
    const before = blendWeight(begin), after = blendWeight(end);
    const fades = before - after > NOTHING, whole = fades ? Math.min(before / (before - after), MOST_WHOLE) : 1;
    const share = fades ? (before - blendWeight(frame)) / (before - after) : (frame - begin) / Math.max(end - begin, NOTHING);
    // The node turned into the world: as its end shows it, less what is left of the blend offset.
    const turn = start[2] - ah, change = wrapAngle(goal[2] - bh - turn);
    const c = Math.cos(turn + whole * change), s = Math.sin(turn + whole * change);
    const ox = start[0] - (c * ax - s * ay), oy = start[1] - (s * ax + c * ay);
    const wayX = this.shorter(goal[0] - (c * bx - s * by) - ox, 0), wayY = this.shorter(goal[1] - (s * bx + c * by) - oy, 1);
    return [
      c * p[0] - s * p[1] + ox + share * wayX, s * p[0] + c * p[1] + oy + share * wayY, p[2] + turn + share * change,
    ];
  }
}
