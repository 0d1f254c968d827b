// Reads the tracks of a chunk as crowdsim/export/page/tracks/track_kernels.py codes them, which says why it is so.

import { RangeDecoder, WHOLE } from "./range_decoder.js";

const PLACE_BITS = 7, TURN_BITS = 8, NEAR_BITS = 6, FRAME_BITS = 6, PHASE_BITS = 7;
const BUCKETS = 9, MOST_ACROSS = 29, SLOWEST = 0.25;

// Where the models of each kind begin.
const FIRST_X = WHOLE, FIRST_Y = 3 * WHOLE, FIRST_TURN = 5 * WHOLE, FIRST_FRAME = 7 * WHOLE, FIRST_PHASE = 8 * WHOLE;
const X = 9 * WHOLE;
const Y = X + ((2 * BUCKETS * BUCKETS) << PLACE_BITS);
const PLAIN_X = Y + ((3 * 10 * (MOST_ACROSS + 1)) << PLACE_BITS);
const PLAIN_Y = PLAIN_X + (BUCKETS << PLACE_BITS);
const IS_CLOSE = PLAIN_Y + ((3 * BUCKETS) << PLACE_BITS);
const NEAR = IS_CLOSE + 2 * 3 * 3;
const TURN = NEAR + ((2 * 15) << NEAR_BITS);
const ON = TURN + ((2 * 2 * BUCKETS) << TURN_BITS);
const FRAME = ON + ((2 * BUCKETS) << TURN_BITS);
const RESTS = FRAME + ((2 * BUCKETS) << FRAME_BITS);
const PHASE = RESTS + 16 * 7;
const MODELS = PHASE + ((16 * 7) << PHASE_BITS);

const CLASSES = Uint8Array.from({ length: 26 }, (_, size) => [4, 7, 11, 17, 24].reduce(
  (kind, most) => kind + (size > most ? 1 : 0), Math.min(size, 3),
));

/** The class, 0 to 8, of the size of a difference. */
function bucket(size) {
  return CLASSES[Math.min(size, 25)];
}

function signed(value) {
  return 2 * bucket(Math.abs(value)) + (value > 0 ? 1 : 0);
}

/** The angle of a vector, within 1e-5: with the same bits everywhere, which Math.atan2 need not give. */
function direction(x, y) {
  const a = Math.abs(x), b = Math.abs(y);
  if (a === 0 && b === 0) return 0;
  const z = Math.min(a, b) / Math.max(a, b), s = z * z;
  let angle = z * (0.999866 + s * (-0.3302995 + s * (0.180141 + s * (-0.085133 + s * 0.0208351))));
  if (b > a) angle = 0.5 * Math.PI - angle;
  if (x < 0) angle = Math.PI - angle;
  return y < 0 ? -angle : angle;
}

/** An integer angle between minus half a turn and half a turn. */
function wrapped(value, turn) {
  const half = Math.floor(turn / 2);
  value = (value + half) % turn;
  return (value < 0 ? value + turn : value) - half;
}

/** Cycles a second that are expected at a speed, so many radians off the heading, while turning. */
function cadence(speed, angle, turn) {
  const off = Math.abs(angle), follows = Math.min(speed / 0.4, 1);
  const hip = off >= 1.4 ? 0 : Math.min(off, 1.4 - off);
  const rest = off - hip * follows * follows, s = rest * rest;
  let c = 1 - s * (0.5 - s * (1 / 24 - s * (1 / 720 - s * (1 / 40320 - s / 3628800))));
  c = Math.min(Math.max(c, -1), 1);
  const along = speed * Math.abs(c), across = speed * Math.sqrt(1 - c * c), turning = Math.abs(turn);
  let rate = Math.sqrt(0.39 * along) / 0.78;
  if (c < 0) rate *= 1.35;
  rate = Math.max(rate, Math.min(0.5 * Math.min(1, across / 0.1) + 1.1 * across, 1.7));
  rate = Math.max(rate, Math.min(0.35 * Math.min(1, turning / 0.2) + 0.4 * turning, 1.5));
  rate = Math.max(rate, speed / 1.6);
  if (rate < 0.45) return speed > 0.1 ? 0.6 : 0.75;
  return rate;
}

/** Reads one agent after the other. coding: see `code_chunk`; x, y, heading: integers of the agent read last. */
export class TrackDecoder {
  constructor(bytes, coding, span) {
    this.reader = new RangeDecoder(bytes, MODELS);
    [this.place, this.turn, this.rate, this.cycle, this.most, this.natural] = coding;
    [this.x, this.y, this.heading] = [0, 1, 2].map(() => new Int32Array(span));
  }

  /** Places and headings from step `first` to before `end`. steered: whether the agent is, by step. */
  track(steered, first, end) {
    this.places(steered, first, end);
    this.headings(steered, first, end);
  }

  places(steered, first, end) {
    const { reader, x, y } = this;
    let ax = 0, ay = 0, before = 0;
    for (let t = first; t < end; t++) {
      if (t < first + 2) {
        const second = WHOLE * (t - first);
        x[t] = reader.whole(FIRST_X + second) + (t > first ? x[t - 1] : 0);
        y[t] = reader.whole(FIRST_Y + second) + (t > first ? y[t - 1] : 0);
        continue;
      }
      const lately = bucket(Math.floor((2 * (Math.abs(ax) + Math.abs(ay)) + before) / 3));
      const some = Math.min(Math.floor(lately / 3), 2);
      before = Math.abs(ax) + Math.abs(ay);
      if (steered[t]) {
        ax = reader.number(X + ((2 * BUCKETS * lately + signed(ax)) << PLACE_BITS), PLACE_BITS);
        const across = 10 * Math.min(Math.abs(ax), MOST_ACROSS) + 2 * (bucket(Math.abs(ay)) >> 1) + (ay > 0 ? 1 : 0);
        ay = reader.number(Y + ((3 * across + some) << PLACE_BITS), PLACE_BITS);
      } else {
        ax = reader.number(PLAIN_X + (lately << PLACE_BITS), PLACE_BITS);
        ay = reader.number(PLAIN_Y + ((3 * bucket(Math.abs(ax)) + some) << PLACE_BITS), PLACE_BITS);
      }
      x[t] = ax + 2 * x[t - 1] - x[t - 2];
      y[t] = ay + 2 * y[t - 1] - y[t - 2];
    }
  }

  headings(steered, first, end) {
    const { reader, x, y, heading, turn, rate, most } = this;
    let close = 0, last = 0;
    for (let t = first; t < end; t++) {
      if (t < first + 2) {
        heading[t] = reader.whole(FIRST_TURN + WHOLE * (t - first)) + (t > first ? heading[t - 1] : 0);
        continue;
      }
      if (!steered[t]) {
        last += reader.number(ON + (signed(last) << TURN_BITS), TURN_BITS);
        heading[t] = heading[t - 1] + last;
        continue;
      }
      const dx = x[t - 1] - x[t - 2], dy = y[t - 1] - y[t - 2], speed = this.speed(dx, dy);
      const wanted = wrapped(this.ahead(dx, dy) - heading[t - 1], turn);
      const expected = Math.min(Math.max(wanted, -most), most), free = Math.abs(wanted) < most;
      const kind = 3 * (speed > SLOWEST + 0.02 ? 0 : speed > SLOWEST - 0.02 ? 1 : 2) + (free ? 0 : wanted > 0 ? 1 : 2);
      if (reader.bit(IS_CLOSE + 9 * close + kind) === 0) {
        const context = 2 * Math.min(Math.floor(10 * speed), 14) + (free ? 1 : 0);
        last = expected + reader.number(NEAR + (context << NEAR_BITS), NEAR_BITS);
        close = 0;
      } else {
        last = reader.number(TURN + ((2 * signed(last) + (wanted > 0 ? 1 : 0)) << TURN_BITS), TURN_BITS);
        close = 1;
      }
      heading[t] = heading[t - 1] + last;
    }
  }

  speed(dx, dy) {
    return (Math.sqrt(dx * dx + dy * dy) * this.rate) / this.place;
  }

  ahead(dx, dy) {
    return Math.floor((direction(dx, dy) * this.turn) / (2 * Math.PI) + 0.5);
  }

  /** Frames of a node into `out` from `at` on, while it is played for so many steps. */
  frames(out, at, count, scale) {
    const { reader } = this;
    let last = 0, value = reader.whole(FIRST_FRAME);
    out[at] = value * scale;
    for (let k = 1; k < count; k++) {
      last += reader.number(FRAME + (signed(last) << FRAME_BITS), FRAME_BITS);
      value += this.natural + last;
      out[at + k] = value * scale;
    }
  }

  /** Phases of a stretch into `out` from `at` on, from step `first` to before `end` of the track. */
  phases(out, at, first, end) {
    const { reader, x, y, heading, turn, rate, cycle } = this;
    let off = 0, moved = 1, value = reader.whole(FIRST_PHASE);
    out[at] = value / cycle;
    for (let t = first + 1; t < end; t++) {
      const dx = x[t] - x[t - 1], dy = y[t] - y[t - 1], speed = this.speed(dx, dy);
      const angle = (wrapped(this.ahead(dx, dy) - heading[t], turn) * (2 * Math.PI)) / turn;
      const turning = ((wrapped(heading[t] - heading[t - 1], turn) * (2 * Math.PI)) / turn) * rate;
      const expected = Math.floor((cadence(speed, angle, turning) / rate) * cycle + 0.5);
      const past = (((2 * value) % cycle) + cycle) % cycle;
      const stage = (speed < 0.35 && 10 * past <= 2 * cycle ? 1 : 0) + (100 * past < 52 * cycle ? 2 : 0);
      const context = 2 * (2 * (4 * Math.min(bucket(Math.abs(off)), 6) + stage) + moved) + (off > 0 ? 1 : 0);
      moved = 1 - reader.bit(RESTS + context);
      if (moved) {
        off = reader.number(PHASE + (context << PHASE_BITS), PHASE_BITS);
        value += expected + off;
      }
      out[at + t - first] = value / cycle;
    }
  }
}
