// Tracks from the page itself. Other sources, such as live/live_source.js, derive from this one.

import { NodeTracks } from "./node_tracks.js";
import { StepTracks, splitStep } from "./step_tracks.js";
import { TrackDecoder } from "./track_decoder.js";
import { varints } from "./unpack.js";

export const ABSENT = 0, MOVING = 1, WAITING = 2, ARRIVED = 3;
const STEERED = 4; // added to a state
const CHUNKS_KEPT = 8; // of at most a million samples: 130 MB

/** State of all agents at one time, in arrays. */
export function newFrame(count) {
  return {
    time: 0, step: 0, share: 0,
    x: new Float64Array(count), y: new Float64Array(count), heading: new Float64Array(count),
    speed: new Float64Array(count), frame: new Float64Array(count),
    node: new Int32Array(count), previous: new Int32Array(count),
    behavior: new Int8Array(count), state: new Int8Array(count), steered: new Int8Array(count),
  };
}

export class FileSource {
  constructor(block) {
    const { facts } = block;
    this.facts = facts;
    this.block = block;
    this.rate = facts.rate;
    this.steps = facts.steps;
    this.count = facts.agents.length;
    this.nodeTracks = new NodeTracks(block);
    this.nodeFrames = this.nodeTracks.frames;
    this.stepTracks = new StepTracks(this.nodeTracks, this.rate, facts.ends);
    this.chunks = new Map();
    this.readEvents();
    this.stretches = readStretches(block, this.count);
  }

  /** Read the changes of all agents: see pack_events of track_chunks.py. */
  readEvents() {
    const { block, count } = this;
    const counts = varints(block.array("event_counts"));
    this.firstEvent = new Int32Array(count + 1);
    for (let i = 0; i < count; i++) this.firstEvent[i + 1] = this.firstEvent[i] + counts[i];
    const since = varints(block.array("event_steps"));
    this.eventStep = new Int32Array(since.length);
    for (let i = 0; i < count; i++) {
      let step = 0;
      for (let e = this.firstEvent[i]; e < this.firstEvent[i + 1]; e++) this.eventStep[e] = step += since[e];
    }
    this.eventNode = varints(block.array("event_nodes")).map((value) => value - 1);
    this.eventPrevious = varints(block.array("event_previous")).map((value) => value - 1);
    this.eventBehavior = Int8Array.from(block.array("event_behaviors"), (value) => value - 1);
    this.eventState = block.array("event_states");
    this.cursor = this.firstEvent.slice(0, count);
  }

  /** The event that holds for an agent at a step. */
  eventAt(agent, step) {
    const first = this.firstEvent[agent], last = this.firstEvent[agent + 1] - 1;
    let at = this.cursor[agent];
    if (this.eventStep[at] > step || (at < last && this.eventStep[Math.min(at + 2, last)] <= step)) {
      // Far from the event found last: search by halves.
      let low = first, high = last;
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (this.eventStep[middle] <= step) low = middle;
        else high = middle - 1;
      }
      at = low;
    }
    while (at < last && this.eventStep[at + 1] <= step) at += 1;
    this.cursor[agent] = at;
    return at;
  }

  /** The event that holds at the step after a step in which `e` holds. */
  nextEvent(agent, e, step) {
    return e + 1 < this.firstEvent[agent + 1] && this.eventStep[e + 1] === step + 1 ? e + 1 : e;
  }

  /** The unpacked chunk that holds a step. */
  chunkOf(step) {
    const number = Math.floor(step / this.facts.chunk);
    let chunk = this.chunks.get(number);
    if (chunk === undefined) {
      if (this.chunks.size >= CHUNKS_KEPT) this.chunks.delete(this.chunks.keys().next().value);
      chunk = this.unpackChunk(number);
    } else {
      this.chunks.delete(number);
    }
    // Chunks are in the order of their last use: the first one goes first.
    this.chunks.set(number, chunk);
    return chunk;
  }

  /** Tracks of a chunk; the phases of its steps go to their stretches. */
  unpackChunk(number) {
    const { chunk: length, margin, units, coding } = this.facts;
    const low = Math.max(number * length - margin, 0);
    const high = Math.min((number + 1) * length + margin, this.steps);
    const span = high - low, size = this.count * span;
    const [x, y, heading, frame] = [0, 1, 2, 3].map((k) => new Float32Array(size).fill(k < 3 ? NaN : 0));
    const decoder = new TrackDecoder(this.block.array(`chunk_${number}`), coding, span, this.nodeTracks);
    const node = new Int32Array(span), turn = (2 * Math.PI) / units.turn;
    for (let agent = 0; agent < this.count; agent++) {
      const base = agent * span;
      node.fill(-1);
      for (const [first, end] of this.runs(agent, low, high, (e) => this.eventNode[e])) {
        node.fill(this.eventNode[this.eventAt(agent, first)], first - low, end - low);
      }
      for (const [first, end] of this.runs(agent, low, high, (e) => (this.eventState[e] & 3 ? 1 : -1))) {
        decoder.track(node, first - low, end - low);
        for (let t = first - low; t < end - low; t++) {
          x[base + t] = decoder.shown[3 * t] / units.place;
          y[base + t] = decoder.shown[3 * t + 1] / units.place;
          heading[base + t] = decoder.shown[3 * t + 2] * turn;
          if (node[t] >= 0) frame[base + t] = decoder.frame[t] / units.frame;
        }
      }
      for (const { begin, stop, phases } of this.stretches[agent]) {
        const first = Math.max(begin, low), end = Math.min(stop, high);
        // Steps of the margins belong to other chunks.
        const own = number * length - low;
        if (first < end) decoder.phases(phases, first - begin, first - low, end - low, own, own + length);
      }
    }
    return { low, high, span, x, y, heading, frame };
  }

  /** Stretches of steps [first, end) in which `key` of the events stays the same and is not -1. */
  runs(agent, low, high, key) {
    const found = [];
    let e = this.eventAt(agent, low), since = low, value = key(e);
    const last = this.firstEvent[agent + 1];
    while (since < high) {
      let end = high;
      for (e += 1; e < last && this.eventStep[e] < high; e++) {
        if (key(e) !== value) {
          end = this.eventStep[e];
          break;
        }
      }
      if (value >= 0) found.push([since, end]);
      if (end >= high) break;
      since = end;
      value = key(e);
    }
    return found;
  }

  /** Track of an agent at a step into `out`: x, y [m], heading [rad], frame of its node. */
  trackAt(agent, step, out) {
    const chunk = this.chunkOf(step), i = agent * chunk.span + step - chunk.low;
    out[0] = chunk.x[i];
    out[1] = chunk.y[i];
    out[2] = chunk.heading[i];
    out[3] = chunk.frame[i];
    return out;
  }

  /** State of all agents at a time [s], also between steps, into `frame`, as of Recording.at_time. */
  frameAt(time, frame) {
    const place = Math.min(Math.max(time * this.rate, this.low ?? 0), this.steps - 1);
    const step = Math.floor(place + 1e-6);
    let share = place - step;
    if (share < 1e-6) share = 0;
    frame.time = time;
    frame.step = step;
    frame.share = share;
    const chunk = this.chunkOf(step);
    for (let agent = 0; agent < this.count; agent++) this.between(chunk, agent, step, share, frame);
    return frame;
  }

  /** State of an agent at a share of the step from `step` to the next one, into the arrays of `out`. */
  between(chunk, agent, step, share, out) {
    const e = this.eventAt(agent, step), i = agent * chunk.span + step - chunk.low;
    const state = this.eventState[e] & 3;
    out.state[agent] = state;
    out.steered[agent] = this.eventState[e] & STEERED ? 1 : 0;
    out.behavior[agent] = this.eventBehavior[e];
    const node = (out.node[agent] = this.eventNode[e]);
    out.previous[agent] = this.eventPrevious[e];
    out.x[agent] = chunk.x[i];
    out.y[agent] = chunk.y[i];
    out.heading[agent] = chunk.heading[i];
    const from = (out.frame[agent] = chunk.frame[i]);
    out.speed[agent] = 0;
    const walks = (state === MOVING || state === WAITING) && step + 1 < this.steps;
    if (!walks) return;
    const next = this.nextEvent(agent, e, step);
    if (!(this.eventState[next] & 3)) return;
    const tracks = this.stepTracks, newNode = this.eventNode[next];
    const old = { node, frame: from, track: [chunk.x[i], chunk.y[i], chunk.heading[i]] };
    const now = { node: newNode, frame: chunk.frame[i + 1], track: [chunk.x[i + 1], chunk.y[i + 1], chunk.heading[i + 1]] };
    const dx = tracks.shorter(now.track[0] - old.track[0], 0), dy = tracks.shorter(now.track[1] - old.track[1], 1);
    out.speed[agent] = Math.hypot(dx, dy) * this.rate;
    if (share === 0) return;
    [out.x[agent], out.y[agent], out.heading[agent]] = tracks.between(old, now, share);
    if (node < 0) return;
    // Nodes may be played slower or faster.
    const to = newNode < 0 ? 0 : now.frame, last = this.nodeFrames[node];
    if (newNode === node && to >= from) {
      out.frame[agent] = Math.min(from + share * (to - from), to);
      return;
    }
    const { part, end, begin } = splitStep(last, from, to, tracks.natural);
    if (newNode >= 0 && share > part) {
      out.node[agent] = newNode;
      out.previous[agent] = this.eventPrevious[next];
      out.behavior[agent] = this.eventBehavior[next];
      out.frame[agent] = begin + ((to - begin) * (share - part)) / (1 - part);
    } else {
      out.frame[agent] = part > 0 ? from + ((end - from) * Math.min(share, part)) / part : from;
    }
  }

  /** Seconds for which an agent has waited until a time. */
  waitedUntil(agent, time) {
    let steps = 0;
    const step = time * this.rate, last = this.firstEvent[agent + 1];
    for (let e = this.firstEvent[agent]; e < last && this.eventStep[e] < step; e++) {
      if ((this.eventState[e] & 3) !== WAITING) continue;
      steps += Math.min(e + 1 < last ? this.eventStep[e + 1] : this.steps, step) - this.eventStep[e];
    }
    return steps / this.rate;
  }
}

/** Stretches of steps in which agents are steered, by agent. Phases are NaN until their chunks are unpacked. */
function readStretches(block, count) {
  const { place, turn, phase, exact, turn_step: turnStep, phase_step: phaseStep } = block.facts.units;
  const units = [place, place, turn / (2 * Math.PI) / turnStep, phase / phaseStep], fractions = block.array("stretch_exact");
  const agents = varints(block.array("stretch_agents"));
  const [begins, firsts, ends, stops] = ["begins", "firsts", "ends", "stops"].map(
    (name) => varints(block.array(`stretch_${name}`)),
  );
  const byAgent = Array.from({ length: count }, () => []);
  const size = fractions.length / agents.length;
  for (let k = 0; k < agents.length; k++) {
    const begin = begins[k], first = begin + firsts[k], end = first + ends[k], stop = end + stops[k];
    const ours = fractions.subarray(size * k, size * (k + 1));
    byAgent[agents[k]].push({
      begin, first, end, stop, phases: new Float64Array(stop - begin).fill(NaN),
      exact: Array.from(ours, (value, i) => value / exact / units[i % 4]),
    });
  }
  return byAgent;
}
