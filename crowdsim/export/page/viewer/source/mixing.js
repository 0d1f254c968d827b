// Numbers near 0, coded by decisions that three models expect together: see crowdsim/export/page/tracks/mixing_kernels.py.

import { EVEN, RangeDecoder, TOP } from "./range_decoder.js";

const CHANCE_BITS = 12, CHANCES = 1 << CHANCE_BITS, MOST = 2047, WEIGHT_BITS = 16, LEARNING = 24, PATIENCE = 127, LARGEST = (1 << 18) - 1;
const COUNT_BITS = 7, COUNTS = (1 << COUNT_BITS) - 1; // of a model, below its chance
const LOGIT_SHIFT = COUNT_BITS + 16 - CHANCE_BITS;
const INPUTS = 3, FIRST_WEIGHT = Math.round((1.4 / INPUTS) * 2 ** WEIGHT_BITS);

// Chances of the logits -2048, -1920, ... 2048, as in mixing_kernels.py.
const POINTS = [
  1, 2, 3, 6, 10, 16, 27, 45, 73, 120, 194, 310, 488, 747, 1101, 1546, 2047, 2549, 2994, 3348, 3607, 3785, 3901, 3975,
  4022, 4050, 4068, 4079, 4085, 4089, 4092, 4093, 4094,
];
const CHANCE = Int32Array.from({ length: 2 * MOST + 1 }, (_, k) => {
  const logit = k - MOST, index = (logit >> 7) + 16, share = logit & 127;
  return (POINTS[index] * (128 - share) + POINTS[index + 1] * share + 64) >> 7;
});
const LOGIT = new Int32Array(CHANCES).fill(MOST);
for (let chance = 0, k = 0; chance < CHANCES; chance++) {
  while (k <= 2 * MOST && CHANCE[k] < chance) k += 1;
  LOGIT[chance] = Math.min(k, 2 * MOST) - MOST;
}
const SHARE = Int32Array.from({ length: PATIENCE + 1 }, (_, count) => Math.round(32768 / (count + 1.5)));

/** A weight within its limits. */
function limited(weight) {
  return weight < -LARGEST ? -LARGEST : weight > LARGEST ? LARGEST : weight;
}

/** A model (its chance, and the number of its decisions) after one more decision, moved towards `goal`, 0 or 65535. */
function adapted(model, goal) {
  const count = model & COUNTS, chance = model >> COUNT_BITS;
  const next = chance + (Math.imul(goal - chance, SHARE[count]) >> 15);
  return (next << COUNT_BITS) | (count < PATIENCE ? count + 1 : count);
}

export class MixingDecoder extends RangeDecoder {
  /** models: number of those that are used alone, `mixed` of those that are mixed, `rows` of weights. */
  constructor(bytes, models, mixed, rows) {
    super(bytes, models);
    this.models = new Int32Array(mixed).fill(EVEN << COUNT_BITS); // chance and count
    this.weights = new Int32Array(INPUTS * rows).fill(FIRST_WEIGHT);
  }

  /** A number of so many bits, by models that begin at `a`, `b` and `c`, and weights from row `row` on. */
  leaf(a, b, c, row, bits) {
    // All in one function, in 32 bits, with local variables: most of the time of a page's start is spent here.
    const { models, weights, bytes } = this, end = 1 << bits;
    let { range, code, at } = this, node = 1;
    while (node < end) {
      const i = a + node, j = b + node, k = c + node, w = INPUTS * (row + node);
      const p = models[i], q = models[j], r = models[k], u = weights[w], v = weights[w + 1], x = weights[w + 2];
      const f = LOGIT[p >> LOGIT_SHIFT], g = LOGIT[q >> LOGIT_SHIFT], h = LOGIT[r >> LOGIT_SHIFT];
      const sum = (Math.imul(u, f) + Math.imul(v, g) + Math.imul(x, h)) >> WEIGHT_BITS;
      const chance = CHANCE[sum < -MOST ? 0 : sum > MOST ? 2 * MOST : sum + MOST];
      const bound = (range >>> CHANCE_BITS) * (CHANCES - chance);
      let off, goal;
      if (code < bound) {
        range = bound;
        off = -chance * LEARNING;
        goal = 0;
        node *= 2;
      } else {
        code -= bound;
        range -= bound;
        off = (CHANCES - chance) * LEARNING;
        goal = 65535;
        node = 2 * node + 1;
      }
      weights[w] = limited(u + ((Math.imul(f, off) + 0x8000) >> 16));
      weights[w + 1] = limited(v + ((Math.imul(g, off) + 0x8000) >> 16));
      weights[w + 2] = limited(x + ((Math.imul(h, off) + 0x8000) >> 16));
      models[i] = adapted(p, goal);
      models[j] = adapted(q, goal);
      models[k] = adapted(r, goal);
      while (range < TOP) {
        range *= 256;
        code = code * 256 + (at < bytes.length ? bytes[at++] : 0);
      }
    }
    this.range = range;
    this.code = code;
    this.at = at;
    return node - end;
  }

  /** A number that is mostly near 0; others after an escape. */
  mixed(a, b, c, row, bits) {
    const leaf = this.leaf(a, b, c, row, bits);
    return leaf ? leaf - (1 << (bits - 1)) : this.whole(0);
  }
}
