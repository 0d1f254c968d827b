// Reads the tracks of a chunk; crowdsim/export/page/tracks/track_kernels.py codes them, and explains the code.

import { direction, expectedPhase, nextStand, passes, rest, wrapped } from "./expected.js";
import { MixingDecoder } from "./mixing.js";
import { BLEND_FRAMES, cosSin } from "./node_tracks.js";
import { WHOLE } from "./range_decoder.js";

const PLACE_BITS = 6, TURN_BITS = 7, NEAR_BITS = 6, PHASE_BITS = 6;
const OFF_BITS = 7, ORIGIN_BITS = 8, FRAME_BITS = 6, CHANGE_BITS = 8;
const CLASSES = 9, SIGNED = 2 * CLASSES, MOST_ACROSS = 29, PACES = 16, WAYS = 16;
const SPEEDS = 24, TURNS = 21, WANTED = 49, NEARS = 8, KINDS = 7, AWAYS = 16;

// Where the models of each kind begin.
const FIRST_X = WHOLE, FIRST_Y = 3 * WHOLE, FIRST_TURN = 5 * WHOLE, FIRST_FRAME = 7 * WHOLE, FIRST_PHASE = 8 * WHOLE;
const IS_OFF = 9 * WHOLE, OFF = IS_OFF + 4, ORIGIN = OFF + (3 << OFF_BITS), FRAME = ORIGIN + (3 << ORIGIN_BITS);
const CHANGE = FRAME + (SIGNED << FRAME_BITS), FOLLOWS = CHANGE + (1 << CHANGE_BITS);
const STAYS = FOLLOWS + 2 * KINDS;
const MODELS = STAYS + KINDS;

// The same of models that are mixed, three contexts of each kind, one after the other.
let mixed = 0;
const place = (contexts, bits) => {
  const first = mixed;
  mixed += contexts << bits;
  return first;
};
const X = [SIGNED * CLASSES, CLASSES ** 4, PACES * WAYS * 3].map((size) => place(size, PLACE_BITS));
const Y = [30 * (MOST_ACROSS + 1), SIGNED * CLASSES ** 2, PACES * WAYS * SIGNED].map((size) => place(size, PLACE_BITS));
const IS_NEAR = [SPEEDS * WANTED, TURNS * WANTED, SPEEDS * SPEEDS].map((size) => place(NEARS * size, 1));
const NEAR = [SPEEDS, SPEEDS * TURNS, NEARS * SPEEDS].map((size) => place(size, NEAR_BITS));
const TURN = [2 * TURNS, 8 * WANTED, TURNS * TURNS].map((size) => place(size, TURN_BITS));
const PHASE = [SPEEDS * SIGNED, TURNS * SIGNED, AWAYS * SPEEDS].map((size) => place(KINDS * size, PHASE_BITS));
const MIXED = mixed;

// Where the weights of each kind begin.
const X_ROW = 0, Y_ROW = CLASSES << PLACE_BITS, IS_NEAR_ROW = 2 * Y_ROW, NEAR_ROW = IS_NEAR_ROW + (NEARS << 1);
const TURN_ROW = NEAR_ROW + (1 << NEAR_BITS), PHASE_ROW = TURN_ROW + (1 << TURN_BITS);
const ROWS = PHASE_ROW + (KINDS << PHASE_BITS);

const SIZES = Uint8Array.from({ length: 26 }, (_, size) => [4, 7, 11, 17, 24].reduce(
  (kind, most) => kind + (size > most ? 1 : 0), Math.min(size, 3),
));

/** The class, 0 to 8, of the size of a difference. */
function sizeClass(size) {
  return SIZES[Math.min(size, 25)];
}

/** The class, 0 to 17, of a difference with its sign. */
function signed(value) {
  return 2 * sizeClass(Math.abs(value)) + (value > 0 ? 1 : 0);
}

/** The class, 0 to 8, of a difference with its sign, 4 for 0. */
function coarse(value) {
  const size = Math.abs(value), kind = size === 0 ? 0 : size <= 2 ? 1 : size <= 5 ? 2 : size <= 11 ? 3 : 4;
  return value > 0 ? 4 + kind : 4 - kind;
}

/**
 * Reads one agent after the other. coding: units, see expected_kernels.py; nodes: a NodeTracks. shown: x, y and heading
 * of the agent read last, three a step; x, y and heading: the same in whole units; frame: in ticks.
 */
export class TrackDecoder {
  constructor(bytes, coding, span, nodes) {
    this.reader = new MixingDecoder(bytes, MODELS, MIXED, ROWS);
    this.nodes = nodes;
    [this.place, this.turn, this.rate, this.cycle, this.most, this.natural, this.phaseStep, this.turnStep] = coding;
    this.playedTurnStep = coding[8];
    [this.x, this.y, this.heading, this.ahead, this.frame] = [0, 1, 2, 3, 4].map(() => new Int32Array(span));
    this.shown = new Float64Array(3 * span);
    this.speed = new Float64Array(span);
    this.expected = { phase: 0, kind: 0 };
  }

  /**
   * Read the track from step `begin` to before `stop` into `shown`, x, y, heading and frame. node: what the agent plays in
   * each step, -1 if it is steered.
   */
  track(node, begin, stop) {
    for (let first = begin, end = begin; first < stop; first = end) {
      const played = node[first] >= 0;
      while (end < stop && node[end] >= 0 === played) end += 1;
      if (played) {
        this.frames(node, first, end);
        this.played(node, begin, first, end);
      } else {
        this.places(begin, first, end);
        this.headings(begin, first, end);
        for (let t = first; t < end; t++) this.show(t, this.x[t], this.y[t], this.heading[t]);
      }
    }
  }

  /** Keep the track that is shown in step `t`. */
  show(t, x, y, heading) {
    this.shown[3 * t] = x;
    this.shown[3 * t + 1] = y;
    this.shown[3 * t + 2] = heading;
  }

  /** Speed and direction of the step to `t`. */
  findWay(t) {
    const dx = this.x[t] - this.x[t - 1], dy = this.y[t] - this.y[t - 1];
    this.speed[t] = (Math.sqrt(dx * dx + dy * dy) * this.rate) / this.place;
    this.ahead[t] = Math.floor((direction(dx, dy) * this.turn) / (2 * Math.PI) + 0.5);
  }

  /** Read places from step `first` to before `end` of an agent that is steered; it is present from `begin` on. */
  places(begin, first, end) {
    const { reader, x, y, turn, speed, ahead } = this;
    let ax = 0, ay = 0, bx = 0, by = 0, before = 0;
    for (let t = first; t < end; t++) {
      if (t < begin + 2) {
        const second = WHOLE * (t - begin);
        x[t] = reader.whole(FIRST_X + second) + (t > begin ? x[t - 1] : 0);
        y[t] = reader.whole(FIRST_Y + second) + (t > begin ? y[t - 1] : 0);
        if (t > begin) this.findWay(t);
        continue;
      }
      const lately = sizeClass(Math.floor((2 * (Math.abs(ax) + Math.abs(ay)) + before) / 3));
      const some = Math.min(Math.floor(lately / 3), 2);
      before = Math.abs(ax) + Math.abs(ay);
      const pace = Math.min(Math.floor(10 * speed[t - 1]), PACES - 1);
      const way = WAYS * pace + rest(Math.floor((WAYS * ahead[t - 1]) / turn), WAYS);
      const cx = coarse(ax), cy = coarse(ay), dx = coarse(bx), dy = coarse(by);
      const recent = CLASSES * (CLASSES * (CLASSES * cx + cy) + dx) + dy;
      bx = ax;
      by = ay;
      ax = reader.mixed(
        X[0] + ((SIGNED * lately + signed(ax)) << PLACE_BITS), X[1] + (recent << PLACE_BITS),
        X[2] + ((3 * way + some) << PLACE_BITS), X_ROW + (lately << PLACE_BITS), PLACE_BITS,
      );
      const size = Math.abs(ax), sign = signed(ax);
      const across = 10 * Math.min(size, MOST_ACROSS) + 2 * (sizeClass(Math.abs(by)) >> 1) + (by > 0 ? 1 : 0);
      ay = reader.mixed(
        Y[0] + ((3 * across + some) << PLACE_BITS), Y[1] + ((CLASSES * (CLASSES * sign + cy) + cx) << PLACE_BITS),
        Y[2] + ((SIGNED * way + sign) << PLACE_BITS), Y_ROW + (sizeClass(size) << PLACE_BITS), PLACE_BITS,
      );
      x[t] = ax + 2 * x[t - 1] - x[t - 2];
      y[t] = ay + 2 * y[t - 1] - y[t - 2];
      this.findWay(t);
    }
  }

  /** The class, 0 to 20, of a turn. */
  turnClass(turn) {
    return Math.min(Math.max(Math.floor((10 * turn) / this.most), -10), 10) + 10;
  }

  /** Read headings from step `first` to before `end`, along the places. */
  headings(begin, first, end) {
    const { reader, heading, turn, most, turnStep, speed, ahead } = this;
    const pace = (t) => Math.min(Math.floor(16 * speed[t]), SPEEDS - 1);
    let last = 0, before = 0, lately = 0;
    for (let t = first; t < end; t++) {
      if (t < begin + 2) {
        heading[t] = reader.whole(FIRST_TURN + WHOLE * (t - begin)) + (t > begin ? heading[t - 1] : 0);
        continue;
      }
      const now = pace(t - 1), next = pace(t), wanted = wrapped(ahead[t - 1] - heading[t - 1], turn);
      const expected = Math.min(Math.max(wanted, -most), most), turned = this.turnClass(last);
      const wish = Math.min(Math.max(Math.floor((8 * wanted) / most), -24), 24) + 24;
      const way = reader.leaf(
        IS_NEAR[0] + ((WANTED * (SPEEDS * lately + now) + wish) << 1),
        IS_NEAR[1] + ((WANTED * (TURNS * lately + turned) + wish) << 1),
        IS_NEAR[2] + ((SPEEDS * (SPEEDS * lately + next) + now) << 1), IS_NEAR_ROW + (lately << 1), 1,
      );
      let off = 0;
      if (way === 1) {
        off = reader.mixed(
          TURN[0] + ((2 * turned + (wanted > 0 ? 1 : 0)) << TURN_BITS),
          TURN[1] + ((8 * wish + Math.floor(now / 3)) << TURN_BITS),
          TURN[2] + ((TURNS * turned + this.turnClass(before)) << TURN_BITS), TURN_ROW, TURN_BITS,
        );
      } else if (Math.abs(wanted) < most) {
        off = reader.mixed(
          NEAR[0] + (now << NEAR_BITS), NEAR[1] + ((TURNS * next + this.turnClass(expected)) << NEAR_BITS),
          NEAR[2] + ((SPEEDS * lately + next) << NEAR_BITS), NEAR_ROW, NEAR_BITS,
        );
      }
      lately = (2 * lately + way) % NEARS;
      before = last;
      last = (way ? 0 : expected) + off * turnStep;
      heading[t] = heading[t - 1] + last;
    }
  }

  /** Frames of the nodes that are played. */
  frames(node, first, end) {
    const { reader, frame, nodes } = this;
    let last = 0;
    frame[first] = reader.whole(FIRST_FRAME);
    for (let t = first + 1; t < end; t++) {
      if (node[t] !== node[t - 1]) {
        last += reader.number(CHANGE, CHANGE_BITS);
        frame[t] = frame[t - 1] + this.natural + last - nodes.frames[node[t - 1]] * nodes.ticks;
      } else {
        last += reader.number(FRAME + (signed(last) << FRAME_BITS), FRAME_BITS);
        frame[t] = frame[t - 1] + this.natural + last;
      }
    }
  }

  /** Places and headings while nodes are played: see played_kernels.py. */
  played(node, begin, first, end) {
    const { reader, nodes, frame, x, y, heading, turn, place, playedTurnStep: step } = this;
    const fading = BLEND_FRAMES * nodes.ticks;
    const [origin, offset, ended, shown] = [0, 1, 2, 3].map(() => new Float64Array(3)), way = new Float64Array(2);
    let wasOff = 0;
    for (let t = first; t < end; t++) {
      if (t === begin) {
        [FIRST_X, FIRST_Y, FIRST_TURN].forEach((model, k) => (shown[k] = reader.whole(model)));
      } else if (t === first) {
        [x, y, heading].forEach((column, k) => (shown[k] = column[t - 1]));
        if (t > begin + 1) {
          shown[0] += x[t - 1] - x[t - 2];
          shown[1] += y[t - 1] - y[t - 2];
        }
      } else {
        if (node[t] !== node[t - 1] || frame[t] < frame[t - 1]) {
          const last = node[t - 1];
          nodes.trackAt(last, nodes.frames[last] * nodes.ticks, origin, offset, place, turn, ended);
          const along = reader.number(ORIGIN, ORIGIN_BITS), across = reader.number(ORIGIN + (1 << ORIGIN_BITS), ORIGIN_BITS);
          cosSin(ended[2], turn, way);
          origin[0] = ended[0] + 0.5 * (way[0] * along - way[1] * across);
          origin[1] = ended[1] + 0.5 * (way[1] * along + way[0] * across);
          origin[2] = ended[2] + reader.number(ORIGIN + (2 << ORIGIN_BITS), ORIGIN_BITS) * step;
          for (let k = 0; k < 3; k++) offset[k] = ended[k] - origin[k];
        }
        nodes.trackAt(node[t], frame[t], origin, offset, place, turn, shown);
      }
      if (t > begin) {
        const isOff = reader.bit(IS_OFF + 2 * (frame[t] < fading ? 1 : 0) + wasOff);
        wasOff = isOff;
        for (let k = 0; isOff && k < 3; k++) {
          const by = reader.number(OFF + (k << OFF_BITS), OFF_BITS) * (k === 2 ? step : 1);
          shown[k] += by;
          origin[k] += by;
        }
      }
      if (t === first) nodes.originOf(node[t], frame[t], shown, place, turn, origin);
      x[t] = Math.floor(shown[0] + 0.5);
      y[t] = Math.floor(shown[1] + 0.5);
      heading[t] = Math.floor(shown[2] + 0.5);
      if (t > begin) this.findWay(t);
      this.show(t, shown[0], shown[1], shown[2]);
    }
  }

  /**
   * Phases of a stretch from step `first` to before `end` of the track. Those from step `own` to before `ownEnd` go
   * into `out`, that of `first` to index `at`.
   */
  phases(out, at, first, end, own, ownEnd) {
    const { reader, x, y, heading, turn, cycle, expected, phaseStep } = this;
    let ax = x[first], ay = y[first], left = heading[first], off = 0, value = reader.whole(FIRST_PHASE);
    if (own <= first && first < ownEnd) out[at] = value / cycle;
    for (let t = first + 1; t < end; t++) {
      const dx = x[t] - ax, dy = y[t] - ay, away = Math.sqrt(dx * dx + dy * dy) / this.place;
      expectedPhase(value, this.speed[t], this.ahead[t], heading[t], heading[t - 1], away, left, this, expected);
      const { kind } = expected, before = value;
      if (reader.bit(FOLLOWS + 2 * kind + (off === 0 ? 1 : 0))) {
        if (!reader.bit(STAYS + kind)) value = nextStand(value, cycle);
        off = 0;
      } else {
        const pace = Math.min(Math.floor(16 * this.speed[t]), SPEEDS - 1), sign = signed(off);
        const turned = this.turnClass(Math.abs(wrapped(heading[t] - heading[t - 1], turn)));
        off = reader.mixed(
          PHASE[0] + ((SIGNED * (SPEEDS * kind + pace) + sign) << PHASE_BITS),
          PHASE[1] + ((SIGNED * (TURNS * kind + turned) + sign) << PHASE_BITS),
          PHASE[2] + ((SPEEDS * (AWAYS * kind + Math.min(Math.floor(50 * away), AWAYS - 1)) + pace) << PHASE_BITS),
          PHASE_ROW + (kind << PHASE_BITS), PHASE_BITS,
        );
        value = expected.phase + off * phaseStep;
      }
      if (passes(before, value, cycle)) {
        ax = x[t];
        ay = y[t];
        left = heading[t];
      }
      if (own <= t && t < ownEnd) out[at + t - first] = value / cycle;
    }
  }
}
