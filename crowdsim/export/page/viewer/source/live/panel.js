// The panel of commands: what a click does, doors and obstacles, and the answer to the last command.

const find = (id) => document.getElementById(id);
const WAITS = 3; // steps after which a change that has not come yet waits for agents in its way
const PLACED = ["move", "draw_wall", "set_door"];

export class Panel {
  /** player: what the panel acts on; see live_player.js. */
  constructor(player) {
    this.player = player;
    this.placing = null;
    this.groups = "";
    for (const choice of document.getElementsByName("tool")) {
      choice.addEventListener("change", () => this.setTool(choice.value));
    }
    find("one-step").addEventListener("click", () => player.ask({ do: "step" }));
    find("add").addEventListener("click", () => this.add(null));
    find("take-out").addEventListener("click", () => {
      if (player.selected >= 0) player.ask({ do: "remove_agents", agents: [player.facts.agents[player.selected]] });
    });
    addEventListener("keydown", (event) => {
      // Keys typed into a field are no shortcuts of the viewer.
      if (event.target.closest?.("#live input[type=number]") && event.key !== "Escape") event.stopImmediatePropagation();
    }, { capture: true });
  }

  get stays() {
    return find("stay").checked;
  }

  setTool(tool) {
    this.player.tool = tool;
    find("sending").hidden = tool !== "send";
    find("adding").hidden = tool !== "add";
  }

  /** Let people of the chosen group come, at a place or where they start. */
  add(start) {
    const group = find("group").value;
    if (!group) return this.say("no group can be added to", true);
    const request = { do: "add", group, count: Number(find("how-many").value) };
    return this.player.ask(start ? { ...request, start } : request);
  }

  showState(paused, over, onCall) {
    const words = over || (paused ? "Paused" : "Running");
    find("link").textContent = words[0].toUpperCase() + words.slice(1);
    find("link").classList.remove("lost");
    const names = Object.keys(onCall), left = JSON.stringify(onCall);
    find("none-on-call").hidden = names.length > 0;
    if (left === this.groups) return;
    this.groups = left;
    const chosen = find("group").value;
    find("group").replaceChildren(...names.map((name) => new Option(`${name} (${onCall[name]} left)`, name)));
    if (names.includes(chosen)) find("group").value = chosen;
  }

  showThings(list) {
    if (this.placing) this.say(this.placing.words, false);
    this.placing = null;
    find("things").replaceChildren(...list.filter((thing) => thing.door || thing.there).map((thing) => {
      const row = document.createElement("li"), name = document.createElement("span"), button = document.createElement("button");
      name.textContent = thing.name;
      name.dir = "auto";
      button.type = "button";
      button.textContent = !thing.door ? "Remove" : thing.there ? "Open" : "Close";
      button.setAttribute("aria-label", `${button.textContent} ${thing.name}`);
      button.addEventListener("click", () => this.player.ask(
        thing.door ? { do: "set_door", name: thing.name, open: thing.there } : { do: "remove_obstacle", name: thing.name },
      ));
      row.append(name, button);
      return row;
    }));
  }

  showSelected() {
    const { selected, frame, source } = this.player;
    find("take-out").disabled = selected < 0 || !frame.state[selected];
    if (this.placing && !this.placing.told && source.latest >= this.placing.step + WAITS) {
      this.placing.told = true;
      this.say("It comes as soon as nobody is in the way.", false);
    }
  }

  showAnswer({ ok, words, step }, request) {
    this.say(words, !ok);
    if (ok && PLACED.includes(request.do)) this.placing = { step, words, told: false };
  }

  say(words, refused) {
    const text = words ? words[0].toUpperCase() + words.slice(1) : "";
    if (find("answer").textContent !== text) find("answer").textContent = text;
    find("answer").classList.toggle("refused", refused);
  }
}
