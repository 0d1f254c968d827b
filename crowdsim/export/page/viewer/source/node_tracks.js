// Tracks of the nodes of a motion graph: helpers of crowdsim/export/page/tracks/played_kernels.py in JavaScript.

import { Varints, varints } from "./unpack.js";

export const BLEND_FRAMES = 12;
const UNITS = 10000; // of meters and radians
const WHOLE_TURN = 2 * Math.PI * UNITS;

/** Share of a blend offset that is left after `frame` frames of a node. */
export function blendWeight(frame) {
  if (frame >= BLEND_FRAMES) return 0;
  const u = frame / BLEND_FRAMES;
  return 1 - u * u * (3 - 2 * u);
}

/** Cosine and sine by their series, with the same bits everywhere, into `out`. `turn` of an angle are a whole turn. */
export function cosSin(angle, turn, out) {
  const quarter = Math.floor((4 * angle) / turn + 0.5);
  const r = (angle - quarter * (0.25 * turn)) * ((2 * Math.PI) / turn), s = r * r;
  let c = 1 / 40320 - s * (1 / 3628800 - s / 479001600), d = 1 / 362880 - s * (1 / 39916800 - s / 6227020800);
  c = 1 - s * (0.5 - s * (1 / 24 - s * (1 / 720 - s * c)));
  d = r * (1 - s * (1 / 6 - s * (1 / 120 - s * (1 / 5040 - s * d))));
  const side = ((quarter % 4) + 4) % 4, back = side === 1 || side === 2 ? -1 : 1, up = side > 1 ? -1 : 1;
  out[0] = side % 2 ? back * d : back * c;
  out[1] = side % 2 ? up * c : up * d;
}

/** Number of frames of each node, and its first row; the last number is that of all rows. */
export function nodeRows(block) {
  const frames = varints(block.array("node_frames")), first = new Int32Array(frames.length + 1);
  for (let n = 0; n < frames.length; n++) first[n + 1] = first[n] + frames[n] + 1;
  return { frames, first };
}

export class NodeTracks {
  constructor(block) {
    this.ticks = block.facts.units.frame;
    Object.assign(this, nodeRows(block));
    const count = this.first[this.frames.length], reader = new Varints(block.array("node_tracks"));
    this.rows = new Int32Array(3 * count);
    for (let column = 0; column < 3; column++) {
      for (let row = 0, value = 0; row < count; row++) this.rows[3 * row + column] = value += reader.signed();
    }
    this.now = new Float64Array(4);
    this.way = new Float64Array(2);
  }

  /** Track in a frame of a node, and the share of a blend offset left there, into `now`. */
  find(node, frame) {
    const { frames, first, rows, ticks, now } = this;
    const at = Math.min(frame, frames[node] * ticks), whole = Math.floor(at / ticks), part = (at - whole * ticks) / ticks;
    const row = 3 * (first[node] + whole), after = 3 * Math.min(first[node] + whole + 1, first[node] + frames[node]);
    for (let k = 0; k < 3; k++) now[k] = rows[row + k] + part * (rows[after + k] - rows[row + k]);
    const left = blendWeight(whole);
    now[3] = left + part * (blendWeight(whole + 1) - left);
  }

  /** Track (x, y, heading) in a frame [ticks] of a node that begins at `origin`, into `out` [units of place and turn]. */
  trackAt(node, frame, origin, offset, place, turn, out) {
    const { now, way } = this, unit = place / UNITS;
    this.find(node, frame);
    cosSin(origin[2], turn, way);
    out[0] = origin[0] + unit * (way[0] * now[0] - way[1] * now[1]) + now[3] * offset[0];
    out[1] = origin[1] + unit * (way[1] * now[0] + way[0] * now[1]) + now[3] * offset[1];
    out[2] = origin[2] + (turn / WHOLE_TURN) * now[2] + now[3] * offset[2];
  }

  /** The origin of a node whose track is `shown` in a frame, without blend offset, into `out`. */
  originOf(node, frame, shown, place, turn, out) {
    const { now, way } = this, unit = place / UNITS;
    this.find(node, frame);
    out[2] = shown[2] - (turn / WHOLE_TURN) * now[2];
    cosSin(out[2], turn, way);
    out[0] = shown[0] - unit * (way[0] * now[0] - way[1] * now[1]);
    out[1] = shown[1] - unit * (way[1] * now[0] + way[0] * now[1]);
  }
}
