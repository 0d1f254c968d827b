// Doors and movable obstacles as they are now, and the outline of the one that is being dragged or drawn.

import { BufferAttribute, BufferGeometry, LineSegments, Mesh, faceMaterial, lineMaterial } from "./viewer.js";

const TALL = 1.1; // meters above which things are glass
const HEIGHTS = 8; // number of parts of a thing's height; a ray through a pixel is tested at their ends

export class Things {
  constructor(scene) {
    this.list = [];
    const add = (object, order) => {
      object.renderOrder = order;
      object.frustumCulled = false;
      object.visible = false;
      scene.add(object);
      return object;
    };
    const [face, edge] = [[[0.80, 0.56, 0.38], [0.62, 0.42, 0.28]], [[0.42, 0.25, 0.14], [0.85, 0.66, 0.5]]];
    this.low = [add(new Mesh(new BufferGeometry(), faceMaterial(...face)), 2), add(new LineSegments(new BufferGeometry(), lineMaterial(...edge)), 3)];
    this.tall = [
      add(new Mesh(new BufferGeometry(), faceMaterial(...face, { glass: 0.45 })), 5),
      add(new LineSegments(new BufferGeometry(), lineMaterial(...edge, { opacity: 0.85 })), 6),
    ];
    this.ghost = add(new LineSegments(new BufferGeometry(), lineMaterial([0.05, 0.35, 0.75], [0.55, 0.8, 1])), 7);
  }

  set(list) {
    this.list = list;
    const there = list.filter((thing) => thing.there);
    for (const [meshes, some] of [
      [this.low, there.filter((thing) => thing.top <= TALL)], [this.tall, there.filter((thing) => thing.top > TALL)],
    ]) {
      put(meshes[0], some.flatMap((thing) => thing.corners));
      put(meshes[1], some.flatMap((thing) => thing.lines));
    }
    this.ghost.visible = false;
  }

  named(name) {
    return this.list.find((thing) => thing.name === name);
  }

  /** The obstacle that a ray from `eye` along `way` meets first; null if it meets none. Doors do not count. */
  seen(eye, way) {
    let best = Infinity, found = null;
    for (const thing of this.list) {
      if (!thing.there || thing.door) continue;
      for (let k = 0; k <= HEIGHTS; k++) {
        const far = ((thing.top * k) / HEIGHTS - eye.z) / way.z;
        if (far > 0 && far < best && inside(thing.outline, eye.x + far * way.x, eye.y + far * way.y)) [best, found] = [far, thing];
      }
    }
    return found;
  }

  /** Show the outline of a thing, moved by `by` [m]. */
  showMoved(thing, by) {
    put(this.ghost, thing.lines.map((value, k) => value + (k % 3 < 2 ? by[k % 3] : 0)));
  }

  showWall([ax, ay], [bx, by]) {
    const corners = [[ax, ay, 0], [bx, by, 0], [bx, by, 2.5], [ax, ay, 2.5]];
    put(this.ghost, corners.flatMap((corner, k) => [...corner, ...corners[(k + 1) % 4]]));
  }

  hideGhost() {
    this.ghost.visible = false;
  }
}

function put(object, places) {
  object.geometry.dispose();
  object.geometry = new BufferGeometry();
  object.geometry.setAttribute("position", new BufferAttribute(Float32Array.from(places), 3));
  object.visible = places.length > 0;
}

/** Whether a place lies in a polygon. */
export function inside(outline, x, y) {
  let odd = false;
  for (let k = 0, before = outline.length - 1; k < outline.length; before = k++) {
    const [ax, ay] = outline[k], [bx, by] = outline[before];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) odd = !odd;
  }
  return odd;
}
