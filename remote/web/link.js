// The connection to Limn: pairing, and one WebSocket that reconnects automatically.

const k_pauses_ms = [300, 700, 1500, 3000, 5000, 10000]; // before each further attempt to connect
const k_silence_ms = 8000; // after this time without a requested image the connection is checked
const k_answer_ms = 8000; // an edit that is not answered within this time has failed

async function post(path, message) {
  return fetch(path, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(message),
  });
}

/**
 * Events (detail): "status" {status, why} with status unpaired, connecting, waiting or connected; "hello", "state",
 * "glasses", "glasses_parts"; "refused" (why), of a message that is no edit or comment;
 * "picture" (image of the room) and "answer" (image of the window) {number, json, jpeg}.
 */
export class Link extends EventTarget {
  #socket = null;
  #tries = 0;
  #timer = 0;
  #last_id = 0;
  #waiting = new Map(); // id -> {done, failed, timer} of edits that are not answered yet
  #wants_pictures = false;
  #received_at = 0;
  status = "unpaired";
  role = "look";
  name = "";

  constructor() {
    super();
    addEventListener("online", () => this.#hurry());
    document.addEventListener("visibilitychange", () => this.#hurry());
    // A page in the browser's back/forward cache must not count as a guest.
    addEventListener("pagehide", () => this.#drop());
    addEventListener("pageshow", ({ persisted }) => persisted && this.status !== "unpaired" && this.connect());
    setInterval(() => this.#look_into(), 2000);
  }

  /** Whether this browser was paired and the pairing has not ended since. */
  static get was_paired() {
    return localStorage.getItem("limn.paired") === "yes";
  }

  /** Pairs and connects. On failure returns `why` for the person, and `wait_s` if a new attempt must wait. */
  async pair(pin, name) {
    let answer;
    try {
      answer = await post("/api/pair", { pin, name });
    } catch {
      return { why: "No connection to Limn. Is it running, and are you on its network?" };
    }
    if (answer.status === 401)
      return { why: "That is not the PIN. The operator's window shows it.", is_pin: true };
    if (answer.status === 429) {
      const wait_s = Number(answer.headers.get("Retry-After")) || 60;
      return { why: "Too many wrong PINs.", wait_s };
    }
    if (!answer.ok) {
      const said = await answer.json().catch(() => ({}));
      return { why: said.error ?? `Limn could not pair this device (${answer.status}). Try again.` };
    }
    localStorage.setItem("limn.paired", "yes");
    this.connect();
    return {};
  }

  async leave() {
    await post("/api/leave", {}).catch(() => {});
    this.#end("You have left.");
  }

  connect() {
    clearTimeout(this.#timer);
    this.#drop();
    if (!this.#tries) this.#say("connecting");
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/api/live`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => socket === this.#socket && this.#receive(event.data);
    socket.onclose = () => socket === this.#socket && this.#closed();
    this.#socket = socket;
  }

  /** Triggers an action. Resolves with the number of the first state that includes it, rejects with the reason. */
  edit(action, slot = "", value = "") {
    return this.#ask({ type: "edit", action, slot, value: String(value) });
  }

  /** Draws on a line of light, or moves it, through an image (docs/remote.md). */
  stroke(stroke) {
    return this.#ask({ type: "stroke", ...stroke });
  }

  comment(look, slot, text) {
    return this.#ask({ type: "comment", look, slot, text });
  }

  send(message) {
    if (this.status === "connected")
      this.#socket.send(message instanceof ArrayBuffer ? message : JSON.stringify(message));
  }

  /** Bytes that wait to be sent. */
  get waiting_bytes() {
    return this.#socket?.bufferedAmount ?? 0;
  }

  /** Starts or stops the sending of room images. */
  want_pictures(wants) {
    if (wants === this.#wants_pictures) return;
    this.#wants_pictures = wants;
    this.#received_at = Date.now();
    this.send({ type: "pictures", room: wants });
  }

  #ask(message) {
    if (this.status !== "connected") return Promise.reject(new Error("No connection to Limn. Nothing was changed."));
    const id = ++this.#last_id;
    return new Promise((done, failed) => {
      const timer = setTimeout(() => this.#settle(id, "Limn did not answer. Check whether the change was made."), k_answer_ms);
      this.#waiting.set(id, { done, failed, timer });
      this.send({ ...message, id });
    });
  }

  #settle(id, why, number) {
    const asked = this.#waiting.get(id);
    if (!asked) return;
    this.#waiting.delete(id);
    clearTimeout(asked.timer);
    if (why === undefined) asked.done(number);
    else asked.failed(new Error(why));
  }

  #receive(data) {
    this.#received_at = Date.now();
    if (data instanceof ArrayBuffer) return this.#receive_picture(data);
    const message = JSON.parse(data);
    if (message.type === "hello") {
      this.#tries = 0;
      this.role = message.role;
      this.name = message.name;
      this.#say("connected");
      this.dispatchEvent(new CustomEvent("hello", { detail: message }));
      if (this.#wants_pictures) this.send({ type: "pictures", room: true });
    } else if (message.type === "state") {
      this.dispatchEvent(new CustomEvent("state", { detail: message }));
    } else if (message.type === "done") {
      this.#settle(message.id, undefined, message.number);
    } else if (message.type === "refused") {
      if (message.id === null) this.dispatchEvent(new CustomEvent("refused", { detail: message.why }));
      else this.#settle(message.id, message.why);
    } else if (message.type === "glasses" || message.type === "glasses_parts") {
      this.dispatchEvent(new CustomEvent(message.type, { detail: message }));
    } else if (message.type === "bye") {
      this.#end(message.why || "The session is over.");
    }
  }

  #receive_picture(data) {
    const head = new DataView(data);
    const kind = head.getUint32(0, true),
      number = head.getUint32(4, true),
      length = head.getUint32(8, true);
    const json = length ? JSON.parse(new TextDecoder().decode(new Uint8Array(data, 12, length))) : {};
    const jpeg = new Blob([new Uint8Array(data, 12 + length)], { type: "image/jpeg" });
    this.dispatchEvent(new CustomEvent(kind === 1 ? "picture" : "answer", { detail: { number, json, jpeg } }));
  }

  // A page is not told why its WebSocket closed. A request for the state distinguishes an ended session from a lost network.
  async #closed() {
    const was_connected = this.status === "connected";
    this.#drop();
    if (!this.#tries) this.#say("connecting");
    const code = was_connected ? 0 : await this.#probe();
    if (code === 401) return this.#end("The session is over. Pair again.");
    const pause = k_pauses_ms[Math.min(this.#tries++, k_pauses_ms.length - 1)];
    this.#say("waiting");
    this.#timer = setTimeout(() => this.connect(), pause);
  }

  async #probe() {
    try {
      return (await fetch("/api/state", { signal: AbortSignal.timeout(4000) })).status;
    } catch {
      return 0;
    }
  }

  async #look_into() {
    const is_silent = Date.now() - this.#received_at > k_silence_ms;
    if (this.status !== "connected" || !this.#wants_pictures || document.hidden || !is_silent) return;
    this.#received_at = Date.now();
    if ((await this.#probe()) === 0 && this.status === "connected") this.#closed();
  }

  #hurry() {
    if (this.status === "waiting" && !document.hidden) this.connect();
  }

  #drop() {
    const socket = this.#socket;
    this.#socket = null;
    if (socket && socket.readyState < WebSocket.CLOSING) socket.close();
    for (const id of [...this.#waiting.keys()]) this.#settle(id, "The connection was lost. Check whether the change was made.");
  }

  #end(why) {
    clearTimeout(this.#timer);
    localStorage.removeItem("limn.paired");
    this.#drop();
    this.#say("unpaired", why);
  }

  #say(status, why = "") {
    this.status = status;
    this.dispatchEvent(new CustomEvent("status", { detail: { status, why } }));
  }
}
