// Unpack what the page holds, and play it.

import { BufferAttribute, BufferGeometry, LineSegments, Mesh, Vector3 } from "three";
import { Bodies } from "./bodies.js";
import { FileSource, newFrame } from "./file_source.js";
import { bytesOf } from "./letters.js";
import { ring } from "./ring.js";
import { Player } from "./player.js";
import { faceMaterial, lineMaterial } from "./shaders.js";
import { SteeredBodies } from "./steered_bodies.js";
import { unpack } from "./unpack.js";

/** Show the player that `load` makes of the canvas, and return it. */
async function show(load) {
  const began = performance.now();
  const canvas = document.getElementById("canvas"), words = document.getElementById("message");
  const probe = document.createElement("canvas").getContext("webgl2");
  if (!probe) {
    words.textContent = "This browser cannot draw in 3D: the page needs WebGL 2. Update the browser, or turn on hardware acceleration in its settings.";
    return null;
  }
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  try {
    const player = await load(canvas);
    words.hidden = true;
    let last = performance.now();
    const loop = (now) => {
      // First, so that a picture that fails is not the last one.
      requestAnimationFrame(loop);
      // A tab that was in the background goes on where it was.
      const passed = Math.min((now - last) / 1000, 0.25);
      last = now;
      player.tick(passed);
    };
    player.tick(0);
    requestAnimationFrame(loop);
    window.crowdsim = hooks(player, performance.now() - began);
    return player;
  } catch (error) {
    words.hidden = false;
    words.textContent = `This page cannot be shown: ${error.message}`;
    throw error;
  }
}

/** Hooks for tests and other scripts, as `window.crowdsim`. */
function hooks(player, ready) {
  const frame = newFrame(player.source.count);
  return {
    player,
    ready,
    /** Rows and joints of all agents that are present at a time [s]. */
    at(time) {
      player.source.frameAt(time - player.start, frame);
      const rows = [];
      for (let agent = 0; agent < player.source.count; agent++) {
        if (!player.bodies.pose(agent, frame)) continue;
        rows.push({
          agent: player.facts.agents[agent], node: player.facts.nodes[frame.node[agent]] ?? null,
          frame: frame.frame[agent], x: frame.x[agent], y: frame.y[agent], heading: frame.heading[agent],
          state: frame.state[agent], behavior: frame.behavior[agent], joints: Array.from(player.bodies.positions),
        });
      }
      return rows;
    },
    /** Costs of the frame drawn last. */
    costs: () => ({
      calls: player.renderer.info.render.calls, triangles: player.renderer.info.render.triangles,
      vertices: player.crowd.vertices, milliseconds: player.javascript,
    }),
  };
}

const data = document.getElementById("data");
if (data) {
  show(async (canvas) => {
    const block = await unpack(bytesOf(data.textContent));
    data.remove();
    return new Player(block, new FileSource(block), canvas);
  });
} else {
  // A page without data: another script gets it from a server, and builds on these.
  globalThis.crowdsimViewer = {
    show, unpack, newFrame, ring, Bodies, FileSource, Player, SteeredBodies, faceMaterial, lineMaterial,
    BufferAttribute, BufferGeometry, LineSegments, Mesh, Vector3,
  };
}
