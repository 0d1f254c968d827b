// Density of agents on the floor [1/m2], in the last ten seconds or over the whole run.

import * as THREE from "three";
import { floorMaterial } from "./shaders.js";

const SECONDS = 10;
const STOPS = [[255, 236, 150], [253, 190, 70], [232, 104, 30], [150, 16, 62]];

/** Color of a share from 0 to 1. */
export function heat(share) {
  const place = Math.min(Math.max(share, 0), 1) * (STOPS.length - 1);
  const k = Math.min(Math.floor(place), STOPS.length - 2);
  return STOPS[k].map((value, c) => Math.round(value + (place - k) * (STOPS[k + 1][c] - value)));
}

export class Density {
  constructor(block, source) {
    const { facts } = block;
    this.source = source;
    this.grid = facts.density;
    this.whole = block.array("density");
    this.low = facts.bounds.low;
    this.mode = "off";
    this.shown = -1;
    this.most = 1;
    const { cell, columns, lines } = this.grid;
    this.data = new Uint8Array(4 * columns * lines);
    this.texture = new THREE.DataTexture(this.data, columns, lines);
    this.texture.magFilter = THREE.LinearFilter;
    const geometry = new THREE.PlaneGeometry(columns * cell, lines * cell);
    geometry.translate(this.low[0] + 0.5 * columns * cell, this.low[1] + 0.5 * lines * cell, 0);
    this.mesh = new THREE.Mesh(geometry, floorMaterial(this.texture));
    this.mesh.renderOrder = -16;
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
  }

  set(mode) {
    this.mode = mode;
    this.shown = -1;
    this.mesh.visible = mode !== "off";
  }

  /** Paint the density of a frame, at most once a second; return whether anything changed. */
  update(frame) {
    if (this.mode === "off") return false;
    const second = this.mode === "whole" ? 0 : Math.floor(frame.step / this.source.rate);
    if (second === this.shown) return false;
    this.shown = second;
    this.paint(this.mode === "whole" ? this.whole : this.lately(frame.step));
    return true;
  }

  /** Mean density of each cell in the last SECONDS before a step. */
  lately(step) {
    const { cell, columns, lines } = this.grid, { source } = this;
    const out = new Float32Array(columns * lines), at = new Float64Array(4);
    const every = Math.max(1, Math.round(source.rate / 2));
    const steps = [];
    for (let k = step; k >= 0 && k > step - SECONDS * source.rate; k -= every) steps.push(k);
    for (const k of steps) {
      for (let agent = 0; agent < source.count; agent++) {
        if (!(source.eventState[source.eventAt(agent, k)] & 3)) continue;
        source.trackAt(agent, k, at);
        const column = Math.min(Math.max(Math.floor((at[0] - this.low[0]) / cell), 0), columns - 1);
        const line = Math.min(Math.max(Math.floor((at[1] - this.low[1]) / cell), 0), lines - 1);
        out[line * columns + column] += 1 / (steps.length * cell * cell);
      }
    }
    return out;
  }

  /** Color the cells; the scale ends at the 99th percentile of the cells with agents. */
  paint(values) {
    const sorted = Float32Array.from(values).filter((value) => value > 0).sort();
    const high = sorted.length ? sorted[Math.floor(0.99 * (sorted.length - 1))] : 1;
    this.most = Math.max(high, 0.05);
    for (let k = 0; k < values.length; k++) {
      const share = values[k] / this.most;
      this.data.set([...heat(share), values[k] > 0 ? Math.round(255 * Math.min(0.4 + 0.5 * share, 0.9)) : 0], 4 * k);
    }
    this.texture.needsUpdate = true;
  }
}
