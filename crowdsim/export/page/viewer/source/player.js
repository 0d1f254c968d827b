// The clock, the choices, and the selected agent.

import * as THREE from "three";
import { Bodies } from "./bodies.js";
import { Cameras } from "./cameras.js";
import { shirts } from "./colors.js";
import { Controls } from "./controls.js";
import { Crowd } from "./crowd.js";
import { Density } from "./density.js";
import { newFrame } from "./file_source.js";
import { Paths, Place, Trails } from "./place.js";
import { ring } from "./ring.js";
import { theme } from "./shaders.js";

const PATHS_EVERY = 0.2; // seconds of play after which paths are cut off behind their agents
const TOUCH = 26; // pixels from a body within which a click selects it

export class Player {
  constructor(block, source, canvas) {
    this.facts = block.facts;
    this.source = source;
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.info.autoReset = true;
    this.scene = new THREE.Scene();
    this.cameras = new Cameras(this.facts.bounds, canvas);
    this.bodies = this.makeBodies(block);
    this.crowd = new Crowd(block, source, this.bodies);
    this.place = new Place(block);
    this.pathLines = new Paths(block);
    this.trailLines = new Trails(source, this.facts.most);
    this.density = new Density(block, source);
    this.ring = ring();
    this.scene.add(
      this.place.group, this.density.mesh, this.pathLines.mesh, this.trailLines.mesh, this.ring, this.crowd.group,
    );
    this.frame = newFrame(source.count);
    this.start = this.facts.first / source.rate;
    this.end = this.start + (this.facts.steps - 1) / source.rate;
    this.time = this.facts.opening;
    Object.assign(this, {
      playing: false, speed: 1, color: "behavior", paths: this.facts.paths, walls: true, trails: false,
      night: matchMedia("(prefers-color-scheme: dark)").matches, selected: -1, dirty: true, pathsAt: NaN, javascript: 0,
    });
    this.controls = new Controls(this);
    this.cameras.onMoved = () => this.touch();
    this.cameras.controls.addEventListener("change", () => (this.dirty = true));
    addEventListener("resize", () => this.resize());
    addEventListener("hashchange", () => this.readLink());
    this.listenToClicks();
    this.resize();
    this.readLink();
    this.touch();
  }

  makeBodies(block) {
    return new Bodies(block, this.source);
  }

  get step() {
    return Math.round((this.time - this.start) * this.source.rate);
  }

  /** Something was chosen: show it, and have the next frame drawn. */
  touch() {
    this.pathsAt = NaN;
    this.dirty = true;
    theme.night.value = this.night ? 1 : 0;
    this.renderer.setClearColor(this.night ? 0x101216 : 0xe9eef2);
    this.place.walls.visible = this.walls;
    this.trailLines.mesh.visible = this.trails;
    this.controls.showChoices();
  }

  set(name, value) {
    if (value === undefined) return;
    if (name === "view") {
      if (value === "follow" && (this.selected < 0 || !this.frame.state[this.selected])) this.selectNext(1);
      this.cameras.set(value, this.selected < 0 ? null : this.whereIs(this.selected));
      if (value === "follow" && this.selected < 0) this.cameras.view = "free";
    } else if (name === "density") {
      this.density.set(value);
      this.density.update(this.frame);
    } else {
      this[name] = value;
    }
    this.writeLink();
    this.touch();
  }

  whereIs(agent) {
    const { x, y, heading } = this.frame;
    return { x: x[agent], y: y[agent], heading: heading[agent] };
  }

  toggle() {
    if (!this.playing && this.time >= this.end - 1e-6) this.time = this.start;
    this.playing = !this.playing;
    this.controls.say(this.playing ? "playing" : `paused at ${this.time.toFixed(1)} seconds`);
    if (!this.playing) this.writeLink();
    this.touch();
  }

  seek(time) {
    this.time = Math.min(Math.max(time, this.start), this.end);
    this.writeLink();
    this.touch();
  }

  seekStep(step) {
    this.seek(this.start + step / this.source.rate);
  }

  select(agent) {
    this.selected = agent;
    if (agent < 0 && this.cameras.view === "follow") this.cameras.view = "free";
    this.controls.say(agent < 0 ? "nobody selected" : `agent ${this.facts.agents[agent]} selected`);
    this.writeLink();
    this.touch();
  }

  selectNext(way) {
    const count = this.source.count;
    for (let k = 1; k <= count; k++) {
      const agent = (((this.selected + way * k) % count) + count) % count;
      if (!this.frame.state[agent]) continue;
      this.select(agent);
      if (this.cameras.view === "follow") this.cameras.set("follow", this.whereIs(agent));
      return;
    }
  }

  listenToClicks() {
    let down = null;
    this.canvas.addEventListener("pointerdown", (event) => (down = [event.clientX, event.clientY]));
    this.canvas.addEventListener("pointerup", (event) => {
      if (!down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 6) return;
      this.clicked(event.clientX, event.clientY);
    });
    this.canvas.addEventListener("dblclick", (event) => {
      const agent = this.pick(event.clientX, event.clientY);
      if (agent < 0) return;
      this.select(agent);
      this.set("view", "follow");
    });
  }

  clicked(x, y) {
    this.select(this.pick(x, y));
  }

  /** The agent whose body is nearest to a pixel, -1 if none is near. */
  pick(x, y) {
    const box = this.canvas.getBoundingClientRect(), at = new THREE.Vector3();
    let best = TOUCH, found = -1;
    for (let agent = 0; agent < this.source.count; agent++) {
      if (!this.frame.state[agent]) continue;
      const ends = [0.1, 1.7].map((z) => {
        at.set(this.frame.x[agent], this.frame.y[agent], z).project(this.cameras.camera);
        return [box.left + 0.5 * (at.x + 1) * box.width, box.top + 0.5 * (1 - at.y) * box.height, at.z];
      });
      if (ends[0][2] > 1) continue;
      const dx = ends[1][0] - ends[0][0], dy = ends[1][1] - ends[0][1];
      const share = Math.min(Math.max(((x - ends[0][0]) * dx + (y - ends[0][1]) * dy) / (dx * dx + dy * dy || 1), 0), 1);
      const far = Math.hypot(x - ends[0][0] - share * dx, y - ends[0][1] - share * dy);
      if (far < best) [best, found] = [far, agent];
    }
    return found;
  }

  /** Pixels that the page covers at each side of the picture. */
  insets(width, height) {
    const bar = document.getElementById("bar").getBoundingClientRect();
    const head = document.getElementById("head").getBoundingClientRect();
    return { top: Math.min(head.bottom, 0.3 * height), bottom: Math.min(height - bar.top, 0.4 * height), left: 0, right: 0 };
  }

  resize() {
    const width = innerWidth, height = innerHeight;
    this.renderer.setSize(width, height, false);
    this.cameras.resize(width, height, this.insets(width, height));
    this.dirty = true;
  }

  /** Go on by some seconds of real time, and draw if anything changed. */
  tick(seconds) {
    if (this.playing) {
      this.time = Math.min(this.time + seconds * this.speed, this.end);
      if (this.time >= this.end) this.playing = false;
      this.dirty = true;
    }
    this.cameras.controls.update();
    if (!this.dirty) return;
    this.dirty = false;
    this.draw();
  }

  /** Draw the present moment. */
  draw() {
    const began = performance.now(), { frame } = this;
    this.source.frameAt(this.time - this.start, frame);
    const now = { ...frame, time: frame.time };
    const color = shirts(this.color, this.facts, this.source, now, this.crowd.builds);
    if (this.cameras.view === "follow" && this.selected >= 0 && frame.state[this.selected]) {
      this.cameras.followTo(frame.x[this.selected], frame.y[this.selected]);
    }
    this.crowd.chosen.value = this.selected;
    this.crowd.update(frame, this.cameras.camera, color);
    this.place.update(frame);
    this.drawLines(color);
    if (this.density.update(frame)) this.controls.showChoices();
    const shown = this.selected >= 0 && frame.state[this.selected] > 0;
    this.ring.visible = shown;
    if (shown) this.ring.position.set(frame.x[this.selected], frame.y[this.selected], 0);
    this.javascript = performance.now() - began;
    this.renderer.render(this.scene, this.cameras.camera);
    this.controls.showTime();
  }

  drawLines(color) {
    const { frame } = this;
    if (this.trails) this.trailLines.update(frame, this.whoseLines("all"), color);
    if (Math.abs(this.time - this.pathsAt) < PATHS_EVERY) return;
    this.pathsAt = this.time;
    this.pathLines.update(frame, this.whoseLines(this.paths));
  }

  whoseLines(whose) {
    const agents = this.selected >= 0 && this.frame.state[this.selected] ? [this.selected] : [];
    if (whose === "none" || whose === "selected") return agents;
    return Array.from(this.frame.state.keys()).filter((agent) => this.frame.state[agent] > 0);
  }

  savePicture() {
    this.draw();
    this.canvas.toBlob((blob) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(blob);
      link.download = `${this.facts.scenario.replace(/[^\p{L}\p{N}]+/gu, "-") || "crowd"}-${this.time.toFixed(1)}s.png`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    });
    this.controls.say("picture saved");
  }

  writeLink() {
    const parts = [`t=${this.time.toFixed(2)}`];
    if (this.selected >= 0) parts.push(`agent=${this.facts.agents[this.selected]}`);
    if (this.cameras.view !== "free") parts.push(`view=${this.cameras.view}`);
    history.replaceState(null, "", `#${parts.join("&")}`);
  }

  readLink() {
    const link = new URLSearchParams(location.hash.slice(1));
    const time = Number.parseFloat(link.get("t")), agent = this.facts.agents.indexOf(Number(link.get("agent") ?? NaN));
    if (Number.isFinite(time)) this.time = Math.min(Math.max(time, this.start), this.end);
    this.source.frameAt(this.time - this.start, this.frame);
    if (agent >= 0) this.selected = agent;
    const view = link.get("view");
    if (["overview", "top"].includes(view)) this.cameras.set(view);
    if (view === "follow" && agent >= 0 && this.frame.state[agent]) this.cameras.set("follow", this.whereIs(agent));
    this.touch();
  }
}
