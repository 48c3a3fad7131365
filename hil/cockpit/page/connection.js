// The WebSocket: requests with replies, what the server tells, the sign of life.

const LIFE_MS = 100;
const AGAIN_MS = 1000;
const WAIT_MS = 30000;

/** Let the page in with the token of the address, once; the cookie stays. Returns whether it is in. */
export async function enter() {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (token) {
    history.replaceState(null, "", location.pathname);
    const answer = await fetch("/enter", { method: "POST", body: token });
    if (answer.ok) return true;
  }
  return (await fetch("/enter")).ok;
}

/** Connection to the server; it is made again when it is lost. */
export class Connection {
  constructor() {
    this.listeners = new Map();
    this.requests = new Map();
    this.next = 1;
    this.socket = null;
    this.operating = false;
    this.at = 0; // time of the newest state, which a sign of life carries: an old picture is none to operate by
    setInterval(() => this.#live(), LIFE_MS);
  }

  /** Call a function with every document of a kind; `samples` gets binary frames, `open` and `closed` the connection. */
  on(kind, listener) {
    if (!this.listeners.has(kind)) this.listeners.set(kind, []);
    this.listeners.get(kind).push(listener);
  }

  open() {
    const socket = new WebSocket(`ws://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    socket.addEventListener("open", () => this.#tell("open"));
    socket.addEventListener("message", (event) => this.#receive(event.data));
    socket.addEventListener("close", (event) => this.#closed(event));
    this.socket = socket;
  }

  get connected() {
    return this.socket !== null && this.socket.readyState === WebSocket.OPEN;
  }

  /** Send a message; the promise has the value of the reply, or fails with its sentence. */
  request(kind, fields = {}) {
    if (!this.connected) return Promise.reject(new Error("the connection to the cockpit is lost"));
    const id = this.next++;
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => {
        this.requests.delete(id);
        reject(new Error("the bench does not answer"));
      }, WAIT_MS);
      this.requests.set(id, { resolve, reject, timer });
      this.socket.send(JSON.stringify({ kind, id, ...fields }));
    });
  }

  #live() {
    if (this.operating && this.connected) this.socket.send(`{"kind":"life","at":${this.at}}`);
  }

  #tell(kind, content) {
    for (const listener of this.listeners.get(kind) || []) listener(content);
  }

  #receive(data) {
    if (data instanceof ArrayBuffer) {
      this.#tell("samples", data);
      return;
    }
    const document = JSON.parse(data);
    if (document.kind === "state") this.at = document.at;
    if (document.kind !== "reply") {
      this.#tell(document.kind, document);
      return;
    }
    const waiting = this.requests.get(document.id);
    if (!waiting) return;
    this.requests.delete(document.id);
    clearTimeout(waiting.timer);
    if (document.ok) waiting.resolve(document.value);
    else waiting.reject(new Error(document.error));
  }

  #closed(event) {
    this.operating = false;
    for (const waiting of this.requests.values()) {
      clearTimeout(waiting.timer);
      waiting.reject(new Error("the connection to the cockpit is lost"));
    }
    this.requests.clear();
    this.#tell("closed", event);
    if (event.code !== 4401) setTimeout(() => this.open(), AGAIN_MS);
  }
}
