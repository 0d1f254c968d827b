// Buttons, slider, keys, card and legend. Names from a recording are set as text only, never as HTML.

import { COLORINGS, legend } from "./colors.js";
import { heat } from "./density.js";
import { VIEWS } from "./cameras.js";

export const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
const STATES = ["absent", "moving", "waiting", "arrived"];
const DENSITIES = ["off", "lately", "whole"];

const find = (id) => document.getElementById(id);

export class Controls {
  /** player: what the controls act on; see player.js. */
  constructor(player) {
    this.player = player;
    const { facts } = player;
    find("title").textContent = facts.title;
    document.title = facts.title;
    find("note").textContent = facts.complete ? "" : "The run was stopped; this is its beginning.";
    this.slider = find("slider");
    this.slider.max = String(facts.steps - 1);
    this.drawCurve();
    this.listen();
    this.keys();
  }

  listen() {
    const { player } = this;
    find("play").addEventListener("click", () => player.toggle());
    this.slider.addEventListener("input", () => player.seekStep(Number(this.slider.value)));
    find("speed").addEventListener("change", (event) => player.set("speed", Number(event.target.value)));
    for (const [id, values] of [["view", VIEWS], ["color", COLORINGS], ["density", DENSITIES], ["paths", ["all", "selected", "none"]]]) {
      find(id).addEventListener("change", (event) => player.set(id, values.find((value) => value === event.target.value)));
    }
    for (const id of ["walls", "trails"]) find(id).addEventListener("change", (event) => player.set(id, event.target.checked));
    find("theme").addEventListener("click", () => player.set("night", !player.night));
    find("picture").addEventListener("click", () => player.savePicture());
    find("help").addEventListener("click", () => this.toggleKeys());
    find("more").addEventListener("click", () => {
      const open = document.body.classList.toggle("open");
      find("more").setAttribute("aria-expanded", String(open));
      player.resize();
    });
    find("close-keys").addEventListener("click", () => find("keys").close());
    find("close-card").addEventListener("click", () => player.select(-1));
    find("follow").addEventListener("click", () => player.set("view", "follow"));
  }

  keys() {
    const { player } = this;
    const next = (id, values, now) => player.set(id, values[(values.indexOf(now) + 1) % values.length]);
    const actions = {
      " ": () => player.toggle(), k: () => player.toggle(),
      ArrowLeft: () => player.seek(player.time - 1), ArrowRight: () => player.seek(player.time + 1),
      ",": () => player.seekStep(player.step - 1), ".": () => player.seekStep(player.step + 1),
      Home: () => player.seekStep(0), End: () => player.seekStep(player.facts.steps - 1),
      "-": () => player.set("speed", SPEEDS[Math.max(SPEEDS.indexOf(player.speed) - 1, 0)]),
      "+": () => player.set("speed", SPEEDS[Math.min(SPEEDS.indexOf(player.speed) + 1, SPEEDS.length - 1)]),
      1: () => player.set("view", "overview"), 2: () => player.set("view", "top"),
      3: () => player.set("view", "follow"), 4: () => player.set("view", "free"),
      c: () => next("color", COLORINGS, player.color), d: () => next("density", DENSITIES, player.density.mode),
      p: () => next("paths", ["all", "selected", "none"], player.paths), w: () => player.set("walls", !player.walls),
      t: () => player.set("trails", !player.trails), s: () => player.savePicture(), l: () => player.set("night", !player.night),
      n: () => player.selectNext(1), b: () => player.selectNext(-1), Escape: () => player.select(-1), "?": () => this.toggleKeys(),
    };
    actions["="] = actions["+"];
    addEventListener("keydown", (event) => {
      const typing = event.target.closest?.("select, dialog[open]");
      if (event.ctrlKey || event.altKey || event.metaKey || (typing && event.key !== "?")) return;
      // A button or a checkbox that has the focus keeps the keys that operate it.
      if (event.target.closest?.("button, input[type=checkbox]") && [" ", "Enter"].includes(event.key)) return;
      const action = actions[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    });
  }

  toggleKeys() {
    const sheet = find("keys");
    if (sheet.open) sheet.close();
    else sheet.showModal();
  }

  /** Show clock, counts and card, which change all the time. */
  showTime() {
    const { player } = this, { frame } = player;
    let present = 0, waiting = 0;
    for (const state of frame.state) {
      if (state) present += 1;
      if (state === 2) waiting += 1;
    }
    const words = `${player.time.toFixed(1)} s`;
    find("clock").textContent = words;
    find("count").textContent = `${present} present, ${waiting} waiting`;
    this.slider.value = String(player.step);
    this.slider.setAttribute("aria-valuetext", `${words}, ${present} present, ${waiting} waiting`);
    find("play").textContent = player.playing ? "❚❚" : "▶";
    find("play").setAttribute("aria-label", player.playing ? "Pause" : "Play");
    this.showCard();
  }

  /** Show the choices and the legend. */
  showChoices() {
    const { player } = this;
    for (const [id, value] of [
      ["speed", player.speed], ["view", player.cameras.view], ["color", player.color],
      ["density", player.density.mode], ["paths", player.paths],
    ]) find(id).value = String(value);
    find("walls").checked = player.walls;
    find("trails").checked = player.trails;
    document.documentElement.dataset.theme = player.night ? "dark" : "light";
    const rows = legend(player.color, player.facts).map(([name, color]) => legendRow(name, color));
    if (player.density.mode !== "off") {
      const { most } = player.density;
      for (const share of [0, 0.5, 1]) rows.push(legendRow(`${(share * most).toFixed(most < 1 ? 2 : 1)} /m²`, heat(share), true));
    }
    find("legend").replaceChildren(...rows);
  }

  showCard() {
    const { player } = this, { facts, frame, selected } = player;
    const card = find("card");
    card.hidden = selected < 0;
    if (selected < 0) return;
    const here = frame.state[selected] > 0, behavior = facts.behaviors[frame.behavior[selected]];
    const node = frame.node[selected], goal = facts.goals[selected];
    const number = (value) => value.toFixed(2);
    find("card-title").textContent = `Agent ${facts.agents[selected]}`;
    const rows = [
      ["group", facts.groups[facts.group_of[selected]]],
      ["state", STATES[frame.state[selected]]],
      ["behavior", here && behavior ? behavior.name.replaceAll("_", " ") : "–"],
      ["motion", !here ? "–" : frame.steered[selected] ? "steered" : node >= 0 ? `${facts.nodes[node]}, frame ${Math.round(frame.frame[selected])}` : "–"],
      ["speed", here ? `${number(frame.speed[selected])} m/s` : "–"],
      ["place", here ? `${number(frame.x[selected])}, ${number(frame.y[selected])} m` : "–"],
      ["goal", goal[0] === null ? "–" : `${number(goal[0])}, ${number(goal[1])} m`],
      ["waited", `${player.source.waitedUntil(selected, frame.time).toFixed(1)} s`],
    ];
    const list = find("card-rows");
    if (list.children.length !== 2 * rows.length) {
      list.replaceChildren(...rows.flatMap(() => [document.createElement("dt"), document.createElement("dd")]));
    }
    rows.forEach(([name, value], k) => {
      list.children[2 * k].textContent = name;
      if (list.children[2 * k + 1].textContent !== value) list.children[2 * k + 1].textContent = value;
    });
    find("follow").disabled = !here;
  }

  /** Announce words to screen readers. */
  say(words) {
    find("said").textContent = words;
  }

  drawCurve() {
    const { moving, waiting } = this.player.facts.curve, canvas = find("curve");
    const most = Math.max(1, ...moving.map((count, k) => count + waiting[k]));
    canvas.width = moving.length;
    canvas.height = 40;
    const pen = canvas.getContext("2d");
    moving.forEach((count, k) => {
      const high = (38 * (count + waiting[k])) / most, low = (38 * waiting[k]) / most;
      pen.fillStyle = "rgba(60, 130, 190, 0.55)";
      pen.fillRect(k, 40 - high, 1, high);
      pen.fillStyle = "rgba(230, 140, 40, 0.85)";
      pen.fillRect(k, 40 - low, 1, low);
    });
  }
}

function legendRow(name, color, round = false) {
  const row = document.createElement("li"), dot = document.createElement("span"), words = document.createElement("span");
  dot.className = round ? "dot square" : "dot";
  dot.style.background = `rgb(${color.join(",")})`;
  words.textContent = name;
  words.dir = "auto";
  row.append(dot, words);
  return row;
}
