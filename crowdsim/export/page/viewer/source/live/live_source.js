// Tracks from the socket: the last minute of all agents, step by step, with the interface of FileSource.

import { FileSource } from "./viewer.js";

const STEERED = 4, WAITING = 2; // as in file_source.js
const MOST = 4_000_000; // rows of all agents together
const LEAST = 4; // seconds that are kept of any crowd
const KINDS = {
  float32: Float32Array, int8: Int8Array, uint16: Uint16Array, int16: Int16Array, int32: Int32Array, uint32: Uint32Array,
};
const HEAD = 12; // bytes before the columns of a picture
const LONGEST_GAP = 2; // seconds without pictures that are filled

export class LiveSource extends FileSource {
  constructor(block) {
    super(block);
    const { facts } = block, { count, rate } = this;
    this.columns = facts.columns;
    this.span = Math.max(Math.min(Math.round(facts.kept * rate), Math.floor(MOST / count)), LEAST * rate);
    const size = count * this.span + 1; // one more, for agents in steps that are not known
    this.chunk = { low: 0, span: this.span };
    for (const name of ["x", "y", "heading", "frame"]) this.chunk[name] = new Float32Array(size);
    this.eventNode = new Int32Array(size);
    this.eventPrevious = new Int32Array(size);
    this.eventBehavior = new Int8Array(size);
    this.eventState = new Uint8Array(size);
    this.phase = new Float32Array(size);
    this.steeredSince = new Int32Array(count);
    this.waited = new Float64Array(count);
    this.latest = -1;
    this.low = 0;
    this.lost = 0;
  }

  eventAt(agent, step) {
    return step < this.low || step > this.latest ? this.count * this.span : agent * this.span + step - this.low;
  }

  nextEvent(agent, e) {
    return e + 1;
  }

  chunkOf() {
    return this.chunk;
  }

  waitedUntil(agent) {
    return this.waited[agent] / this.rate;
  }

  /** Take a picture; return false if its step is not new. */
  put(view) {
    const step = view.getUint32(4, true), rows = view.getUint32(8, true);
    if (this.latest >= 0 && step <= this.latest) return false;
    const gap = step - this.latest;
    if (this.latest < 0 || gap > LONGEST_GAP * this.rate) this.beginAt(step);
    while (step - this.low >= this.span) this.forgetHalf();
    const before = this.latest;
    this.latest = step;
    this.steps = step + 1;
    this.write(step, this.read(view, rows), before);
    if (before >= 0) {
      this.lost += gap - 1;
      for (let k = before + 1; k < step; k++) this.fill(k, before, step);
    }
    return true;
  }

  read(view, rows) {
    const columns = { rows };
    let at = HEAD;
    for (const [name, kind] of this.columns) {
      columns[name] = new KINDS[kind](view.buffer, at, rows);
      at += rows * KINDS[kind].BYTES_PER_ELEMENT;
    }
    return columns;
  }

  write(step, columns, before) {
    const { chunk, facts } = this, turn = (2 * Math.PI) / facts.turn;
    for (let agent = 0; agent < this.count; agent++) {
      const i = this.eventAt(agent, step);
      this.eventState[i] = 0;
      chunk.x[i] = chunk.y[i] = chunk.heading[i] = NaN;
      this.eventNode[i] = this.eventPrevious[i] = this.eventBehavior[i] = -1;
    }
    for (let k = 0; k < columns.rows; k++) {
      const agent = columns.agent[k], i = this.eventAt(agent, step);
      const phase = columns.phase ? columns.phase[k] : NaN, steered = !Number.isNaN(phase);
      chunk.x[i] = columns.x[k];
      chunk.y[i] = columns.y[k];
      chunk.heading[i] = columns.heading[k] * turn;
      chunk.frame[i] = columns.frame && !steered ? columns.frame[k] : 0;
      this.eventNode[i] = columns.node && !steered ? columns.node[k] : -1;
      this.eventPrevious[i] = columns.previous && !steered ? columns.previous[k] : -1;
      this.eventBehavior[i] = columns.behavior[k];
      this.eventState[i] = columns.state[k] + (steered ? STEERED : 0);
      this.phase[i] = steered ? phase : 0;
      if (steered && (before < 0 || !(this.eventState[this.eventAt(agent, before)] & STEERED))) this.steeredSince[agent] = step;
      if (columns.state[k] === WAITING) this.waited[agent] += before < 0 ? 1 : step - before;
    }
  }

  /** Interpolate a step that was lost between the known ones `before` and `after`. */
  fill(step, before, after) {
    const share = (step - before) / (after - before), { chunk } = this;
    for (let agent = 0; agent < this.count; agent++) {
      const a = this.eventAt(agent, before), b = this.eventAt(agent, after), i = this.eventAt(agent, step);
      const both = this.eventState[a] && this.eventState[b];
      for (const column of [this.eventNode, this.eventPrevious, this.eventBehavior, this.eventState]) column[i] = column[a];
      const goesOn = both && (this.eventState[a] & STEERED) === (this.eventState[b] & STEERED) && this.eventNode[a] === this.eventNode[b];
      for (const column of [chunk.x, chunk.y, chunk.frame, this.phase]) {
        column[i] = both && (goesOn || column === chunk.x || column === chunk.y) ? column[a] + share * (column[b] - column[a]) : column[a];
      }
      chunk.heading[i] = chunk.heading[a];
    }
  }

  beginAt(step) {
    this.low = this.chunk.low = step;
    this.latest = -1;
    this.steeredSince.fill(step);
  }

  forgetHalf() {
    const half = this.span >> 1, { chunk, span } = this;
    const all = [chunk.x, chunk.y, chunk.heading, chunk.frame, this.eventNode, this.eventPrevious, this.eventBehavior, this.eventState, this.phase];
    for (const column of all) {
      for (let agent = 0; agent < this.count; agent++) column.copyWithin(agent * span, agent * span + half, (agent + 1) * span);
    }
    this.low = chunk.low = this.low + half;
  }

  /** The stretch in which an agent is steered at a step, up to the last known step; null if it is not steered. */
  stretchOf(agent, step) {
    if (!(this.eventState[this.eventAt(agent, step)] & STEERED)) return null;
    const since = Math.max(this.steeredSince[agent], this.low);
    // `steeredSince` holds the begin of the last stretch only; search for that of an earlier one.
    let first = step;
    if (step >= since) first = since;
    else while (first > this.low && this.eventState[this.eventAt(agent, first - 1)] & STEERED) first -= 1;
    let stop = step + 1;
    if (step >= since && this.eventState[this.eventAt(agent, this.latest)] & STEERED) stop = this.latest + 1;
    else while (stop <= this.latest && this.eventState[this.eventAt(agent, stop)] & STEERED) stop += 1;
    const i = this.eventAt(agent, first);
    return { begin: first, first, end: stop, stop, phases: this.phase.subarray(i, i + stop - first), exact: [] };
  }
}
