// The live page begins here: connect, wait for the first picture, and show what comes.

import { Connection } from "./connection.js";
import { LivePlayer } from "./live_player.js";
import { LiveSource } from "./live_source.js";
import { show, unpack } from "./viewer.js";

class Live {
  constructor() {
    this.connection = new Connection(this);
    this.player = null;
    this.source = null;
    this.block = null;
    this.things_ = [];
    this.state_ = null;
    document.getElementById("message").textContent = "Connecting …";
    this.connection.open();
  }

  link(connected) {
    const words = document.getElementById("link");
    words.classList.toggle("lost", !connected);
    if (!connected) words.textContent = "No connection: the simulation has ended, or cannot be reached. Trying again …";
    else if (this.state_) this.state(this.state_);
  }

  async opening(bytes) {
    if (this.block) return; // the page was connected before, and goes on
    this.block = unpack(bytes);
    this.source = new LiveSource(await this.block);
    if (this.early) this.picture(this.early);
  }

  picture(view) {
    if (!this.source) {
      this.early = view; // the opening is being unpacked
      return;
    }
    this.early = null;
    const first = this.source.latest < 0;
    if (this.source.put(view) && first && !this.begun) this.begin();
    if (this.player) this.player.dirty = true;
  }

  async begin() {
    this.begun = true;
    const block = await this.block;
    this.player = await show((canvas) => new LivePlayer(block, this.source, canvas, this.connection));
    if (!this.player) return;
    this.player.setThings(this.things_);
    if (this.state_) this.state(this.state_);
  }

  things(list) {
    this.things_ = list;
    this.player?.setThings(list);
  }

  state(facts) {
    this.state_ = facts;
    this.player?.setState(facts);
  }
}

globalThis.crowdsimLive = new Live();
