// The window (tablet view): frames of this device's camera are sent to Limn, which returns them with the parts drawn in. Only one
// frame is in flight. The page shows only returned frames, so parts and camera image always belong together.
import { by_id, h, icon, set_text } from "/dom.js";
import { draw_picture } from "/pictures.js";

const k_widths = [320, 480, 640, 800, 960, 1280]; // give whole heights at 4:3, 16:9 and 16:10
const k_first = 2; // index of the first width
const k_slow_ms = 160,
  k_fast_ms = 80; // limits of the time from grab to answer: frames get smaller above k_slow_ms, larger below k_fast_ms
const k_trials = 8; // number of answers before the width may change again
const k_quality = [0.6, 0.7, 0.75, 0.75, 0.8, 0.8];
const k_lost_ms = 4000; // a frame without an answer after this time is given up

const k_parts = [
  ["screen", "As the screen"],
  ["rest", "Not projected"],
  ["full", "Whole parts"],
];

const k_refusals = {
  NotAllowedError:
    "The camera was refused. Allow it for this page in the browser's settings, then open the window again.",
  NotFoundError: "This device has no camera.",
  NotReadableError: "Another program uses the camera. Close it, then open the window again.",
  OverconstrainedError: "This device has no suitable camera.",
};

// A lens belongs to one camera in one orientation of the device; each has a name that is made once and stored.
function device_name(camera, is_upright) {
  const key = `limn.device ${camera} ${is_upright ? "upright" : "lying"}`;
  const kept = localStorage.getItem(key);
  if (kept) return kept;
  const bytes = crypto.getRandomValues(new Uint8Array(8));
  const name = `web-${[...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
  localStorage.setItem(key, name);
  return name;
}

/** Chooses the width of frames from how long the last ones took, and how much of that time was Limn's. */
export class Pace {
  #at = k_first;
  #since = 0;
  #limn_ms = 0;
  mean_ms = 0;
  get width() {
    return k_widths[this.#at];
  }
  get quality() {
    return k_quality[this.#at];
  }
  take(ms, limn_ms) {
    this.mean_ms = this.mean_ms ? 0.8 * this.mean_ms + 0.2 * ms : ms;
    this.#limn_ms = this.#limn_ms ? 0.8 * this.#limn_ms + 0.2 * limn_ms : limn_ms;
    if (++this.#since < k_trials) return;
    // Smaller frames help when the network is slow. When Limn is slow, the width does not shrink below the first one, because
    // markers would become too small.
    const may_shrink = this.#at > k_first || this.#limn_ms < this.mean_ms / 2;
    const step = this.mean_ms > k_slow_ms && may_shrink ? -1 : this.mean_ms < k_fast_ms ? 1 : 0;
    const at = Math.min(Math.max(this.#at + step, 0), k_widths.length - 1);
    if (at === this.#at) return;
    // The time is roughly proportional to the number of pixels.
    const scale = (k_widths[at] / k_widths[this.#at]) ** 2;
    this.mean_ms *= scale;
    this.#limn_ms *= scale;
    this.#at = at;
    this.#since = 0;
  }
}

class CameraWindow {
  #session;
  #stage;
  #panel;
  #video = h("video", { playsinline: "", muted: true, "aria-hidden": "true", tabindex: "-1" });
  #grabbed = document.createElement("canvas");
  #shown = by_id("window-picture");
  #stream = null;
  #pace = new Pace();
  #number = 0;
  #in_flight = null; // {number, at, timer}
  #device = "";
  #times = []; // times of the last answers, ms
  #lock = null;
  #announced = ""; // the last announced device and choice of parts
  parts = localStorage.getItem("limn.window.parts") ?? "screen";

  constructor(session, stage) {
    this.#session = session;
    this.#stage = stage;
    by_id("view").append(this.#video); // some browsers give no frames of a video outside the document
    const { link } = session;
    link.addEventListener("answer", ({ detail }) => this.#answer(detail));
    link.addEventListener("hello", () => this.#resume());
    document.addEventListener("visibilitychange", () => this.#send());
    this.#panel = make_panel(this, session);
  }

  show(state) {
    this.#panel.follows(state);
  }

  get is_open() {
    return this.#stream !== null;
  }

  async open() {
    if (this.is_open) return;
    if (!isSecureContext || !navigator.mediaDevices)
      return this.#fail("Browsers allow the camera only with https. Use the https address that Limn shows.");
    try {
      this.#stream = await navigator.mediaDevices.getUserMedia({
        video: { facingMode: { ideal: "environment" }, width: { ideal: 1280 }, height: { ideal: 960 } },
        audio: false,
      });
      this.#video.srcObject = this.#stream;
      await this.#video.play();
    } catch (refusal) {
      this.close();
      return this.#fail(k_refusals[refusal.name] ?? `The camera did not open: ${refusal.message}`);
    }
    this.#stream.getVideoTracks()[0].addEventListener("ended", () => {
      this.close();
      this.#fail("The camera stopped.");
    });
    this.#lock = await navigator.wakeLock?.request("screen").catch(() => null);
    this.#panel.show(true);
    this.#say("Looking for markers …");
    this.#resume();
  }

  close() {
    for (const track of this.#stream?.getTracks() ?? []) track.stop();
    if (this.#device) this.#session.link.send({ type: "window", device: this.#device, on: false });
    this.#stream = null;
    this.#device = this.#announced = "";
    this.#lock?.release();
    this.#lock = null;
    this.#forget();
    this.#stage.give_to_window(false);
    by_id("window-numbers").hidden = true;
    this.#say("");
    this.#panel.show(false);
  }

  #say(words) {
    this.#stage.words = words;
    this.#stage.say_why();
  }

  #fail(words) {
    this.#panel.say(words);
  }

  #forget() {
    clearTimeout(this.#in_flight?.timer);
    this.#in_flight = null;
  }

  #resume() {
    if (!this.is_open) return;
    this.#device = this.#announced = "";
    this.#forget();
    this.#send();
  }

  /** Chooses how this window draws the parts: screen, rest or full. */
  choose_parts(parts) {
    this.parts = parts;
    localStorage.setItem("limn.window.parts", parts);
  }

  // Sends Limn the name of the lens and the choice of parts, if the camera, its orientation or the choice has changed.
  #announce(width, height) {
    const settings = this.#stream.getVideoTracks()[0].getSettings();
    const device = device_name(settings.deviceId ?? "camera", height > width);
    const announced = `${device} ${this.parts}`;
    if (announced === this.#announced) return;
    this.#device = device;
    this.#announced = announced;
    this.#session.link.send({ type: "window", device, on: true, parts: this.parts });
  }

  async #send() {
    const { link } = this.#session;
    if (!this.is_open || this.#in_flight || document.hidden || link.status !== "connected") return;
    const number = (this.#number = (this.#number + 1) >>> 0);
    const frame = (this.#in_flight = { number, at: performance.now(), timer: 0 });
    const { videoWidth, videoHeight } = this.#video;
    const long = Math.max(videoWidth, videoHeight),
      scale = Math.min(1, this.#pace.width / long);
    this.#grabbed.width = Math.round(videoWidth * scale);
    this.#grabbed.height = Math.round(videoHeight * scale);
    this.#grabbed
      .getContext("2d", { alpha: false })
      .drawImage(this.#video, 0, 0, this.#grabbed.width, this.#grabbed.height);
    const jpeg = await new Promise((done) => this.#grabbed.toBlob(done, "image/jpeg", this.#pace.quality));
    const bytes = jpeg && (await jpeg.arrayBuffer());
    if (!bytes || frame !== this.#in_flight) return;
    this.#announce(videoWidth, videoHeight);
    const message = new Uint8Array(4 + bytes.byteLength);
    new DataView(message.buffer).setUint32(0, number, true);
    message.set(new Uint8Array(bytes), 4);
    link.send(message.buffer);
    frame.timer = setTimeout(() => {
      this.#forget();
      this.#send();
    }, k_lost_ms);
  }

  // An answer to another frame than the one in flight belongs to a frame that was given up; it is never shown.
  async #answer({ number, json, jpeg }) {
    const frame = this.#in_flight;
    if (!this.is_open || frame?.number !== number) return;
    clearTimeout(frame.timer);
    const sees = json.sees !== "nothing" && jpeg.size > 0;
    if (sees) await this.#show(jpeg, number);
    if (frame !== this.#in_flight) return;
    this.#stage.give_to_window(sees);
    this.#say(sees ? "" : json.why || "No markers in view. Point the camera at the prototype.");
    const limn_ms = Object.values(json.ms ?? {}).reduce((sum, ms) => sum + ms, 0);
    this.#pace.take(performance.now() - frame.at, limn_ms);
    this.#times = [...this.#times.slice(-19), performance.now()];
    this.#tell(json, limn_ms);
    Object.assign(this.#shown.dataset, { number, sees: json.sees, rms: json.rms_px ?? "" });
    this.#in_flight = null;
    this.#video.requestVideoFrameCallback ? this.#at_next_frame() : this.#send();
  }

  #at_next_frame() {
    let is_sent = false;
    const send = () => {
      if (is_sent) return;
      is_sent = true;
      this.#send();
    };
    this.#video.requestVideoFrameCallback(send);
    setTimeout(send, 100); // a stopped camera gives no frame
  }

  async #show(jpeg, number) {
    try {
      draw_picture(this.#shown, await createImageBitmap(jpeg));
    } catch {
      this.#session.say(`The image of frame ${number} could not be read.`, true);
    }
  }

  #tell(json, limn_ms) {
    const [first, last] = [this.#times[0], this.#times.at(-1)];
    const rate = this.#times.length > 1 ? (1000 * (this.#times.length - 1)) / (last - first) : 0;
    const lines = [
      `${this.#grabbed.width} × ${this.#grabbed.height}, ${rate.toFixed(0)}/s, ${this.#pace.mean_ms.toFixed(0)} ms (Limn ${limn_ms.toFixed(0)})`,
    ];
    if (json.rms_px !== undefined) lines.push(`${json.markers ?? 0} markers, fit ${json.rms_px.toFixed(2)} px`);
    const focal = json.lens?.values?.[0];
    if (focal)
      lines.push(
        `focal ${focal.toFixed(0)} ± ${json.lens.focal_stddev_px.toFixed(1)} px, ${json.lens.frames} frames`,
      );
    const numbers = by_id("window-numbers");
    set_text(numbers, lines.join("\n"));
    numbers.hidden = false;
  }
}

// A switch that makes this device the viewer that `view` parts are drawn for.
function make_follow(session) {
  const is_on = (state) => state.viewer === session.link.name;
  const words = h("small", {});
  const button = session.button(
    "viewer",
    {
      role: "switch",
      "aria-checked": "false",
      class: "switch grow",
      value: () => (is_on(session.state) ? "" : session.link.name),
    },
    icon("window"),
    h("span", {}, "Light for this device", words),
  );
  button.show = (state) => {
    button.setAttribute("aria-checked", String(is_on(state)));
    const waits = state.follows !== state.viewer;
    const on = waits ? "waits until this device sees markers" : "view parts are drawn for this device";
    set_text(words, is_on(state) ? on : "draw view parts for this device");
  };
  return button;
}

// The guest's choice of how the window draws the parts.
function make_parts_choice(owner) {
  const buttons = k_parts.map(([value, label]) =>
    h(
      "button",
      {
        type: "button",
        "data-parts": value,
        onclick: () => {
          owner.choose_parts(value);
          show();
        },
      },
      label,
    ),
  );
  const show = () => {
    for (const button of buttons) button.setAttribute("aria-pressed", String(button.dataset.parts === owner.parts));
  };
  show();
  return h("div", { class: "choices", role: "group", "aria-label": "What this window draws" }, ...buttons);
}

function make_panel(owner, session) {
  const why = h("p", { role: "alert", class: "bad-words" });
  const words = h(
    "p",
    { class: "soft" },
    "Point this device's camera at the prototype: its image is shown with the parts in it.",
  );
  const open = h(
    "button",
    { type: "button", class: "main grow", onclick: () => toggle() },
    icon("camera"),
    h("span", {}, "Open the window"),
  );
  const full = h(
    "button",
    { type: "button", "aria-label": "Full screen", onclick: () => toggle_full() },
    icon("full"),
  );
  const follow = make_follow(session);
  by_id("window").append(
    h("h2", {}, "Window"),
    words,
    why,
    h("div", { class: "dock stack" }, make_parts_choice(owner), follow, h("div", { class: "line" }, open, full)),
  );
  function toggle() {
    set_text(why, "");
    if (owner.is_open) owner.close();
    else owner.open();
  }
  return {
    say: (text) => set_text(why, text),
    follows: (state) => follow.show(state),
    show(is_open) {
      document.body.classList.toggle("window-open", is_open);
      set_text(open.lastElementChild, is_open ? "Close the window" : "Open the window");
      words.hidden = is_open;
    },
  };
}

function toggle_full() {
  if (document.fullscreenElement) document.exitFullscreen();
  else if (document.documentElement.requestFullscreen)
    by_id("stage")
      .requestFullscreen()
      .catch(() => {});
}

export function make_window(session, stage) {
  const owner = new CameraWindow(session, stage);
  return {
    show: (state) => owner.show(state),
    opened(name) {
      if (name !== "window" && owner.is_open) owner.close();
    },
  };
}
