// Reads what crowdsim/export/page/tracks/range_kernels.py codes: decisions, each in a model that adapts.

export const EVEN = 1 << 15; // probability one half, in units of 1 / 65536
const FAST = 4, SLOW = 7; // binary logarithms of the decisions within which the two estimates of a model adapt
export const TOP = 1 << 24;
export const WHOLE = 64; // models of a number of any size

export class RangeDecoder {
  constructor(bytes, models) {
    this.bytes = bytes;
    this.at = 0;
    this.range = 0xffffffff;
    this.code = 0; // distance of the coded number from the low end of the interval
    for (let k = 0; k < 5; k++) this.code = (this.code * 256 + this.next()) % 4294967296;
    this.fast = new Uint16Array(models).fill(EVEN);
    this.slow = new Uint16Array(models).fill(EVEN);
  }

  /** The next byte; 0 behind the end. */
  next() {
    return this.at < this.bytes.length ? this.bytes[this.at++] : 0;
  }

  /** Widen the interval to TOP or more, byte by byte. */
  widen() {
    while (this.range < TOP) {
      this.range *= 256;
      this.code = this.code * 256 + this.next();
    }
  }

  /** The outcome of a decision. */
  bit(model) {
    const fast = this.fast[model], slow = this.slow[model];
    const bound = (this.range >>> 16) * ((fast + slow) >> 1);
    let bit;
    if (this.code < bound) {
      this.range = bound;
      this.fast[model] = fast + ((65536 - fast) >> FAST);
      this.slow[model] = slow + ((65536 - slow) >> SLOW);
      bit = 0;
    } else {
      this.code -= bound;
      this.range -= bound;
      this.fast[model] = fast - (fast >> FAST);
      this.slow[model] = slow - (slow >> SLOW);
      bit = 1;
    }
    if (this.range < TOP) this.widen();
    return bit;
  }

  /** A number of `bits` bits, each as likely 0 as 1. */
  plain(bits) {
    let value = 0;
    for (let k = 0; k < bits; k++) {
      this.range = this.range >>> 1;
      value *= 2;
      if (this.code >= this.range) {
        this.code -= this.range;
        value += 1;
      }
      this.widen();
    }
    return value;
  }

  /** A number of any size: length in bits and sign by models that begin at `first`, then bits. */
  whole(first) {
    let node = 1;
    while (node < WHOLE) node = 2 * node + this.bit(first + node);
    const length = (node - WHOLE) >> 1, negative = node & 1;
    const size = length > 1 ? 2 ** (length - 1) + this.plain(length - 1) : length;
    return negative ? -size : size;
  }

  /** A number that is mostly near 0, by decisions in a binary tree of models that begin at `first`. */
  number(first, bits) {
    // As in `bit`, but with all values in local variables: most of the time of a page's start is spent here.
    const { fast, slow, bytes } = this, end = 1 << bits;
    let { range, code, at } = this, node = 1;
    while (node < end) {
      const k = first + node, p = fast[k], q = slow[k], bound = (range >>> 16) * ((p + q) >> 1);
      if (code < bound) {
        range = bound;
        fast[k] = p + ((65536 - p) >> FAST);
        slow[k] = q + ((65536 - q) >> SLOW);
        node *= 2;
      } else {
        code -= bound;
        range -= bound;
        fast[k] = p - (p >> FAST);
        slow[k] = q - (q >> SLOW);
        node = 2 * node + 1;
      }
      while (range < TOP) {
        range *= 256;
        code = code * 256 + (at < bytes.length ? bytes[at++] : 0);
      }
    }
    this.range = range;
    this.code = code;
    this.at = at;
    const leaf = node - end;
    return leaf ? leaf - (end >> 1) : this.whole(0);
  }
}
