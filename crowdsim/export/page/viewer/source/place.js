// Floor, obstacles, movables, planned paths, and trails of the last seconds.

import * as THREE from "three";
import { faceMaterial, floorMaterial, lineMaterial } from "./shaders.js";
import { Varints, varints } from "./unpack.js";

const SHADE = 0.28; // meters that obstacles darken the floor about them
const PATH_HALF = 0.024; // half of the width of a path [m]
const TRAIL = 5; // seconds

const geometryOf = (places, spans = null) => {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
  if (spans) geometry.setAttribute("span", new THREE.BufferAttribute(spans, 2));
  return geometry;
};

function tinted(places, tints, index = null) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
  geometry.setAttribute("tint", new THREE.Float32BufferAttribute(tints, 4));
  if (index) geometry.setIndex(index);
  return geometry;
}

export class Place {
  constructor(block) {
    this.group = new THREE.Group();
    this.walls = new THREE.Group();
    this.group.add(this.walls);
    const add = (object, order, to = this.group) => {
      object.renderOrder = order;
      object.frustumCulled = false;
      if (object.geometry.getAttribute("position").count) to.add(object);
      return object;
    };
    const floor = block.array("floor_corners");
    add(new THREE.Mesh(geometryOf(floor), floorOnly()), -20);
    add(new THREE.LineSegments(
      geometryOf(block.array("grid_lines")), lineMaterial([0.885, 0.86, 0.82], [0.25, 0.26, 0.28], { floor: true }),
    ), -19);
    add(new THREE.LineSegments(
      geometryOf(block.array("floor_lines")), lineMaterial([0.55, 0.52, 0.48], [0.5, 0.52, 0.55], { floor: true }),
    ), -18);
    add(shadeAround([block.array("low_lines"), block.array("tall_lines")]), -17);
    add(new THREE.Mesh(geometryOf(block.array("low_corners")), faceMaterial([0.88, 0.78, 0.64], [0.5, 0.45, 0.39])), 0);
    add(new THREE.LineSegments(
      geometryOf(block.array("low_lines")), lineMaterial([0.5, 0.43, 0.35], [0.68, 0.62, 0.55]),
    ), 1);
    add(new THREE.Mesh(
      geometryOf(block.array("tall_corners")), faceMaterial([0.62, 0.7, 0.77], [0.42, 0.52, 0.62], { glass: 0.26 }),
    ), 5, this.walls);
    add(new THREE.LineSegments(
      geometryOf(block.array("tall_lines")), lineMaterial([0.42, 0.48, 0.53], [0.55, 0.62, 0.7], { opacity: 0.85 }),
    ), 6, this.walls);
    this.moving = [
      add(new THREE.Mesh(
        geometryOf(block.array("moving_corners"), block.array("moving_spans")),
        faceMaterial([0.80, 0.56, 0.38], [0.62, 0.42, 0.28], { moving: true }),
      ), 2),
      add(new THREE.LineSegments(
        geometryOf(block.array("moving_lines"), block.array("moving_line_spans")),
        lineMaterial([0.42, 0.25, 0.14], [0.85, 0.66, 0.5], { moving: true }),
      ), 3),
    ];
  }

  update(frame) {
    for (const object of this.moving) object.material.uniforms.step.value = frame.step + frame.share;
  }
}

function floorOnly() {
  const material = lineMaterial([0.965, 0.95, 0.925], [0.17, 0.175, 0.19], { floor: true });
  material.side = THREE.DoubleSide;
  return material;
}

/** Soft darkness on the floor along the feet of obstacles: edges at the floor have the obstacle on their left. */
function shadeAround(outlines) {
  const places = [], tints = [];
  for (const lines of outlines) {
    for (let k = 0; k < lines.length; k += 6) {
      const [ax, ay, az, bx, by, bz] = lines.subarray(k, k + 6);
      const length = Math.hypot(bx - ax, by - ay);
      if (az > 0.02 || bz > 0.02 || length < 1e-3) continue;
      const ox = ((by - ay) / length) * SHADE, oy = (-(bx - ax) / length) * SHADE;
      const corners = [[ax, ay, 1], [bx, by, 1], [bx + ox, by + oy, 0], [ax, ay, 1], [bx + ox, by + oy, 0], [ax + ox, ay + oy, 0]];
      for (const [x, y, near] of corners) {
        places.push(x, y, 0);
        tints.push(0.16, 0.13, 0.1, 0.22 * near);
      }
    }
  }
  return new THREE.Mesh(tinted(places, tints), floorMaterial());
}

/** Ribbons along planned paths; of some agents, the part that lies ahead is drawn. */
export class Paths {
  constructor(block) {
    const { facts } = block;
    this.paths = [];
    this.byAgent = new Map();
    this.drawn = "";
    const places = [], tints = [];
    if (facts.path_count) this.read(block, places, tints);
    const geometry = tinted(places, tints);
    this.index = new THREE.BufferAttribute(new Uint32Array(6 * (places.length / 12)), 1);
    geometry.setIndex(this.index);
    geometry.setDrawRange(0, 0);
    this.mesh = new THREE.Mesh(geometry, floorMaterial());
    this.mesh.renderOrder = -14;
    this.mesh.frustumCulled = false;
  }

  read(block, places, tints) {
    const { facts } = block;
    const [agents, steps, pieces, counts] = ["path_agents", "path_steps", "path_pieces", "piece_counts"].map(
      (name) => varints(block.array(name)),
    );
    const behaviors = block.array("piece_behaviors");
    const total = counts.reduce((sum, count) => sum + count, 0), reader = new Varints(block.array("path_points"));
    const xy = [0, 1].map(() => {
      const values = new Float64Array(total);
      for (let k = 0, value = 0; k < total; k++) values[k] = (value += reader.signed()) / facts.units.place;
      return values;
    });
    const colors = facts.behaviors.map(({ color }) => rgb(color).map((c) => c / 255));
    for (let p = 0, piece = 0, at = 0; p < agents.length; p++) {
      const path = { agent: agents[p], step: steps[p], first: places.length / 12, segments: 0, points: [] };
      for (let k = 0; k < pieces[p]; k++, piece++) {
        for (let n = 0; n < counts[piece]; n++, at++) {
          if (n === 0) continue;
          const [ax, bx, ay, by] = [xy[0][at - 1], xy[0][at], xy[1][at - 1], xy[1][at]];
          const length = Math.hypot(bx - ax, by - ay) || 1;
          const ux = ((bx - ax) / length) * PATH_HALF, uy = ((by - ay) / length) * PATH_HALF;
          // A little longer than the segment, so that no gap opens at a bend.
          for (const [x, y, e, s] of [[ax, ay, -0.5, -1], [bx, by, 0.5, -1], [bx, by, 0.5, 1], [ax, ay, -0.5, 1]]) {
            places.push(x + e * ux - s * uy, y + e * uy + s * ux, 0);
            tints.push(...(colors[behaviors[piece]] ?? [0.5, 0.5, 0.5]), 0.7);
          }
          path.segments += 1;
          path.points.push([ax, ay, bx, by]);
        }
      }
      this.paths.push(path);
      if (!this.byAgent.has(path.agent)) this.byAgent.set(path.agent, []);
      this.byAgent.get(path.agent).push(path);
    }
  }

  /** The path that an agent follows at a step. */
  pathOf(agent, step) {
    let found = null;
    for (const path of this.byAgent.get(agent) ?? []) if (path.step <= step) found = path;
    return found;
  }

  /** Draw the paths of `agents`, as far as they lie ahead. */
  update(frame, agents) {
    const index = this.index.array;
    let count = 0;
    for (const agent of agents) {
      const path = this.pathOf(agent, frame.step);
      if (!path) continue;
      for (let s = ahead(path.points, frame.x[agent], frame.y[agent]); s < path.segments; s++) {
        const v = 4 * (path.first + s);
        for (const k of [0, 1, 2, 0, 2, 3]) index[count++] = v + k;
      }
    }
    this.index.needsUpdate = true;
    this.mesh.geometry.setDrawRange(0, count);
    this.mesh.visible = count > 0;
  }
}

/** The number of the segment that is nearest to a place. */
function ahead(points, x, y) {
  let best = Infinity, found = 0;
  points.forEach(([ax, ay, bx, by], k) => {
    const dx = bx - ax, dy = by - ay;
    const share = Math.min(Math.max(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1), 0), 1);
    const far = Math.hypot(x - ax - share * dx, y - ay - share * dy);
    if (far < best) [best, found] = [far, k];
  });
  return found;
}

/** Where agents walked in the last seconds, as lines that fade. */
export class Trails {
  constructor(source, most) {
    this.source = source;
    this.samples = Math.round(TRAIL * Math.min(source.rate, 10));
    const segments = Math.max(1, Math.min(most, 300)) * this.samples;
    this.places = new Float32Array(6 * segments);
    this.tints = new Float32Array(8 * segments);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(this.places, 3));
    geometry.setAttribute("tint", new THREE.BufferAttribute(this.tints, 4));
    this.mesh = new THREE.LineSegments(geometry, floorMaterial());
    this.mesh.renderOrder = -13;
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
  }

  update(frame, agents, color) {
    const { source } = this, every = Math.max(1, Math.round(source.rate / 10));
    const most = this.places.length / 6, at = new Float64Array(4);
    let k = 0;
    for (const agent of agents) {
      const tint = color(agent);
      let x = frame.x[agent], y = frame.y[agent];
      for (let n = 0; n < this.samples && k < most; n++) {
        const step = frame.step - n * every;
        if (step < 0 || !(source.eventState[source.eventAt(agent, step)] & 3)) break;
        source.trackAt(agent, step, at);
        if (Math.hypot(at[0] - x, at[1] - y) > 1.5) break;
        this.places.set([x, y, 0, at[0], at[1], 0], 6 * k);
        for (const end of [0, 1]) {
          const left = 1 - (n + end) / this.samples;
          this.tints.set([tint[0] / 255, tint[1] / 255, tint[2] / 255, 0.85 * left], 8 * k + 4 * end);
        }
        [x, y] = at;
        k += 1;
      }
    }
    const { geometry } = this.mesh;
    geometry.setDrawRange(0, 2 * k);
    geometry.getAttribute("position").needsUpdate = true;
    geometry.getAttribute("tint").needsUpdate = true;
  }
}

/** Red, green, blue, 0 to 255, of "#rrggbb". */
export function rgb(text) {
  return [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16));
}
