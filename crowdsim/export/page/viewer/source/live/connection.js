// The socket: messages from the simulation, and requests to it. It is opened again if it is lost.

const RETRIES = [500, 1000, 2000, 5000]; // milliseconds
const GZIP = 0x8b1f, PICTURE = 0x314c5343; // first bytes of an opening, and "CSL1"
const LOST = "the connection was lost, and the request with it";

export class Connection {
  /** listener: has opening(bytes), picture(view), things(list), state(facts), and link(connected). */
  constructor(listener) {
    this.listener = listener;
    this.answers = new Map();
    this.number = 0;
    this.tries = 0;
    this.opened = 0;
    this.socket = null;
  }

  open() {
    const address = new URL("/live", location.href);
    address.protocol = "ws:";
    address.search = location.search;
    const socket = (this.socket = new WebSocket(address));
    socket.binaryType = "arraybuffer";
    socket.addEventListener("open", () => {
      this.tries = 0;
      this.opened += 1;
      this.listener.link(true);
    });
    socket.addEventListener("message", ({ data }) => this.take(data));
    socket.addEventListener("close", () => this.closed());
  }

  closed() {
    for (const answer of this.answers.values()) answer({ ok: false, words: LOST });
    this.answers.clear();
    this.listener.link(false);
    setTimeout(() => this.open(), RETRIES[Math.min(this.tries, RETRIES.length - 1)]);
    this.tries += 1;
  }

  take(data) {
    if (typeof data !== "string") {
      const view = new DataView(data);
      if (view.getUint16(0, true) === GZIP) this.listener.opening(new Uint8Array(data));
      else if (view.getUint32(0, true) === PICTURE) this.listener.picture(view);
      return;
    }
    const { kind, ...facts } = JSON.parse(data);
    if (kind === "answer") {
      this.answers.get(facts.id)?.(facts);
      this.answers.delete(facts.id);
    } else if (kind === "things") this.listener.things(facts.things);
    else if (kind === "state") this.listener.state(facts);
  }

  /** Send a request; the promise gives {ok, words, step}. */
  ask(request) {
    if (this.socket?.readyState !== WebSocket.OPEN) return Promise.resolve({ ok: false, words: "there is no connection" });
    const id = (this.number += 1);
    return new Promise((answer) => {
      this.answers.set(id, answer);
      this.socket.send(JSON.stringify({ id, ...request }));
    });
  }
}
