// The block of a page: arrays by name, and facts as JSON.

import { inflated } from "./letters.js";

const MAGIC = 0x31575343; // "CSW1"
const KINDS = {
  float32: Float32Array, float64: Float64Array, int8: Int8Array, uint8: Uint8Array,
  int16: Int16Array, uint16: Uint16Array, int32: Int32Array, uint32: Uint32Array,
};

/** Facts and arrays of a compressed block. */
export async function unpack(packed) {
  const buffer = await inflated(packed).arrayBuffer();
  const view = new DataView(buffer);
  if (view.getUint32(0, true) !== MAGIC) throw new Error("this page holds no recording");
  const length = view.getUint32(4, true);
  const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, length)));
  const start = 8 + length;
  const array = (name) => {
    const [offset, kind, count] = facts.arrays[name];
    return new KINDS[kind](buffer, start + offset, count);
  };
  return { facts, array, has: (name) => name in facts.arrays };
}

/** Reads integers with seven bits a byte, the lowest first, one after the other: see packing.py. */
export class Varints {
  constructor(bytes, at = 0) {
    this.bytes = bytes;
    this.at = at;
  }

  get done() {
    return this.at >= this.bytes.length;
  }

  /** The next integer, 0 or more. */
  next() {
    const bytes = this.bytes;
    let byte = bytes[this.at++];
    if (byte < 128) return byte;
    let value = byte & 127;
    let unit = 128;
    do {
      byte = bytes[this.at++];
      value += (byte & 127) * unit;
      unit *= 128;
    } while (byte >= 128);
    return value;
  }

  /** The next integer of either sign, undoing zigzag of packing.py. */
  signed() {
    const value = this.next();
    return value % 2 ? -(value + 1) / 2 : value / 2;
  }
}

/** All integers in some bytes, each 0 or more. */
export function varints(bytes) {
  const reader = new Varints(bytes);
  const values = [];
  while (!reader.done) values.push(reader.next());
  return Int32Array.from(values);
}
