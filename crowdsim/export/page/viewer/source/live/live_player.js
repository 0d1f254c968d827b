// The viewer on a running simulation: its clock follows the steps that come, and clicks and drags are commands.

import { LiveBodies } from "./live_bodies.js";
import { Things } from "./things.js";
import { Panel } from "./panel.js";
import { Player, Vector3, ring } from "./viewer.js";

const BEHIND = 1.5; // steps by which the picture is late, so that there is always a next step to go on to
const FAR_OFF = 1; // seconds of real time: a larger delay is not caught up but skipped
const A_DRAG = 6; // pixels

export class LivePlayer extends Player {
  constructor(block, source, canvas, connection) {
    super(block, source, canvas);
    this.connection = connection;
    this.things = new Things(this.scene);
    this.pin = ring();
    this.pin.scale.set(0.6, 0.6, 1);
    this.scene.add(this.pin);
    this.tool = "send";
    this.drag = null;
    this.playing = true;
    this.time = source.latest / source.rate;
    this.panel = new Panel(this);
    this.listenToDrags();
  }

  makeBodies(block) {
    return new LiveBodies(block, this.source);
  }

  // The panel stands at the left, or, on narrow screens, above the bar.
  insets(width, height) {
    const panel = document.getElementById("live").getBoundingClientRect(), insets = super.insets(width, height);
    return panel.width < 0.5 * width ? { ...insets, left: panel.right } : insets;
  }

  // Links of a page hold a moment; here there is only the present one.
  readLink() {
    this.source.frameAt(this.time, this.frame);
  }

  writeLink() {}

  seek() {}

  seekStep(step) {
    if (step > this.step) this.ask({ do: "step" });
  }

  toggle() {
    this.ask({ do: "pause", paused: this.playing });
  }

  set(name, value) {
    if (name === "speed" && value !== undefined) this.ask({ do: "set_speed", speed: value });
    else if (name !== "paths") super.set(name, value);
  }

  /** The simulation was paused, goes on, or has another speed. */
  setState({ paused, speed, over, on_call }) {
    this.playing = !paused && !over;
    this.speed = speed;
    this.panel.showState(paused, over, on_call);
    this.touch();
  }

  setThings(list) {
    this.things.set(list);
    this.panel.showThings(list);
    this.touch();
  }

  tick(seconds) {
    const { source } = this, now = source.latest / source.rate;
    const target = this.playing ? now - BEHIND / source.rate : now;
    let time = this.time;
    if (Math.abs(target - time) > FAR_OFF * Math.max(this.speed, 1)) time = target;
    else if (this.playing) time += seconds * this.speed + (target - time) * Math.min(2 * seconds, 1);
    else time = Math.max(Math.min(time + seconds * Math.max(this.speed, 1), target), time);
    time = Math.min(Math.max(time, source.low / source.rate), now);
    if (time !== this.time) this.dirty = true;
    this.time = time;
    this.cameras.controls.update();
    if (!this.dirty) return;
    this.dirty = false;
    this.bodies.begin();
    this.draw();
  }

  draw() {
    const goal = this.selected < 0 || !this.frame.state[this.selected] ? [null, null] : this.facts.goals[this.selected];
    this.pin.visible = goal[0] !== null;
    if (this.pin.visible) this.pin.position.set(goal[0], goal[1], 0);
    super.draw();
    this.panel.showSelected();
  }

  /** Send a request to the simulation, and show the answer. */
  async ask(request) {
    const answer = await this.connection.ask(request);
    this.panel.showAnswer(answer, request);
    this.touch();
    return answer;
  }

  /** The ray from the eye through a pixel: its start, and its direction. */
  look(x, y) {
    const box = this.canvas.getBoundingClientRect(), { camera } = this.cameras;
    camera.updateMatrixWorld();
    const way = new Vector3((2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height, 0.5).unproject(camera);
    return [camera.position, way.sub(camera.position).normalize()];
  }

  /** The place on the floor at a pixel; null if there is none. */
  floorAt(x, y) {
    const [eye, way] = this.look(x, y), far = -eye.z / way.z;
    return far > 0 && Number.isFinite(far) ? [eye.x + far * way.x, eye.y + far * way.y] : null;
  }

  clicked(x, y) {
    const floor = this.floorAt(x, y);
    if (this.tool === "wall") return;
    if (this.tool === "add") {
      if (floor) this.panel.add(floor);
      return;
    }
    const agent = this.pick(x, y);
    if (agent < 0 && floor && this.selected >= 0 && this.frame.state[this.selected]) this.send(this.selected, floor);
    else this.select(agent);
  }

  async send(agent, goal) {
    const on_arrival = this.panel.stays ? "stay" : "leave";
    const { ok } = await this.ask({ do: "set_goal", agents: [this.facts.agents[agent]], goal, on_arrival });
    if (ok) this.facts.goals[agent] = goal;
    this.touch();
  }

  listenToDrags() {
    // Take the event before the camera does, so that dragging a thing does not turn the picture.
    addEventListener("pointerdown", (event) => {
      if (event.target !== this.canvas || !event.isPrimary || event.button !== 0) return;
      const [x, y] = [event.clientX, event.clientY], floor = this.floorAt(x, y);
      if (!floor) return;
      const thing = this.tool === "send" && this.pick(x, y) < 0 ? this.things.seen(...this.look(x, y)) : null;
      if (this.tool !== "wall" && !thing) return;
      this.drag = { thing, floor, x, y };
      this.cameras.controls.enabled = false;
    }, { capture: true });
    addEventListener("pointermove", (event) => this.dragTo(event.clientX, event.clientY));
    addEventListener("pointerup", (event) => this.drop(event.clientX, event.clientY));
    addEventListener("pointercancel", () => this.endDrag());
  }

  dragTo(x, y) {
    const floor = this.drag && this.floorAt(x, y);
    if (!floor) return;
    const { thing, floor: from } = this.drag;
    if (thing) this.things.showMoved(thing, [floor[0] - from[0], floor[1] - from[1]]);
    else this.things.showWall(from, floor);
    this.dirty = true;
  }

  async drop(x, y) {
    if (!this.drag) return;
    const { thing, floor: from, x: fromX, y: fromY } = this.drag, floor = this.floorAt(x, y);
    this.endDrag();
    if (!floor || Math.hypot(x - fromX, y - fromY) <= A_DRAG) return this.things.hideGhost();
    const by = [floor[0] - from[0], floor[1] - from[1]];
    const { ok } = await this.ask(thing ? { do: "move", name: thing.name, by } : { do: "draw_wall", points: [from, floor] });
    if (!ok) this.things.hideGhost();
    this.dirty = true;
  }

  endDrag() {
    this.drag = null;
    this.cameras.controls.enabled = true;
  }
}
