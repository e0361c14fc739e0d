// Glasses: a WebXR session whose own tracking Limn registers to the room. The page sends the eye's poses, and draws the parts
// itself, because a frame from Limn would come too late for a head that turns. glasses_view.js draws; it is loaded when needed.
import { by_id, h, icon, set_text } from "/dom.js";

const k_pose_interval_ms = 33; // between two poses that are sent
const k_parts = [
  ["rest", "Not projected"],
  ["full", "Whole parts"],
];
const k_note_ms = 6000; // for so long a note is shown in the glasses
const k_notes = {
  // by what hides parts
  things: "",
  hands: "Only hands hide parts, because this browser gives no depth of the room.",
  nothing: "Parts are drawn over hands, because this browser gives neither depth of the room nor hands.",
};
const k_refusals = {
  NotAllowedError: "The glasses were refused. Allow this page to use them, then try again.",
  NotSupportedError: "This device cannot show parts over what you see. Use the window instead.",
  InvalidStateError: "The glasses are in use by another page. Close it, then try again.",
};

/** Why this browser cannot use glasses, as a sentence; empty: it can. */
export async function why_no_glasses() {
  if (!isSecureContext)
    return "Browsers allow glasses only with https. Use the https address that Limn shows, or the window.";
  if (!navigator.xr) return "Glasses: this browser has no WebXR. Use the window instead.";
  const is_supported = await navigator.xr.isSessionSupported("immersive-ar").catch(() => false);
  return is_supported
    ? ""
    : "Glasses: this device cannot show parts over what you see (no immersive-ar). Use the window instead.";
}

const seconds = (time) => Number((time / 1000).toFixed(5));

// How the page calls what registers the glasses.
const name_of = (marker) => (marker === "camera" ? "the glasses' own camera" : marker);

class Glasses {
  #link;
  #stage;
  #session; // the remote's session, for the materials of parts
  #xr = null;
  #space = null;
  #view = null;
  #sent_at = 0;
  #is_tracking = true;
  #is_fetching = false;
  #has_camera = false; // as Limn was told
  #placed_at = null; // the first frame that parts were drawn in
  #place = null; // the newest message `glasses`
  #parts = null; // the newest message `glasses_parts`
  #problem = ""; // why Limn refused something
  marker = "";
  parts = localStorage.getItem("limn.glasses.parts") ?? "rest";
  on_change = () => {};

  constructor(session, stage) {
    this.#session = session;
    this.#link = session.link;
    this.#stage = stage;
    this.#link.addEventListener("glasses", ({ detail }) => this.#take_place(detail));
    this.#link.addEventListener("glasses_parts", ({ detail }) => (this.#parts = detail));
    this.#link.addEventListener("refused", ({ detail }) => this.#take_refusal(detail));
    this.#link.addEventListener("hello", () => this.#announce());
    this.#link.addEventListener("status", () => this.#lose_link());
  }

  get is_on() {
    return this.#xr !== null;
  }

  get markers() {
    return this.#place?.markers ?? [];
  }

  /** Whether parts are known that the page does not have yet. */
  get is_fetching() {
    return this.#is_fetching;
  }

  /** What is wrong, or what to do, as a sentence; empty: all is well. */
  get words() {
    if (!this.is_on) return "";
    if (this.#link.status !== "connected") return "No connection to Limn. Trying again …";
    if (this.#problem) return this.#problem;
    if (this.#place?.state === "asleep") return this.#place.why;
    if (!this.#is_tracking) return "The glasses have lost their tracking. Look round slowly, in good light.";
    if (!this.#place) return "Waiting for Limn …";
    return this.#place.state === "registered" ? "" : this.#place.why;
  }

  /** What the glasses cannot do, as a sentence; empty: nothing. */
  get note() {
    return this.#view ? k_notes[this.#view.hidden_by] : "";
  }

  get state() {
    return this.is_on ? (this.#place?.state ?? "waiting") : "off";
  }

  async put_on() {
    const xr = await navigator.xr.requestSession("immersive-ar", {
      optionalFeatures: ["local-floor", "depth-sensing", "hand-tracking", "camera-access"],
      depthSensing: { usagePreference: ["cpu-optimized", "gpu-optimized"], dataFormatPreference: ["luminance-alpha", "float32"] },
    });
    xr.addEventListener("end", () => this.#ended());
    try {
      const { GlassesView } = await import("/glasses_view.js");
      this.#view = await GlassesView.open(xr);
      this.#space = await xr.requestReferenceSpace("local-floor").catch(() => xr.requestReferenceSpace("local"));
    } catch (problem) {
      xr.end();
      throw problem;
    }
    this.#xr = xr;
    this.#space.addEventListener("reset", () => this.#report("lost"));
    xr.addEventListener("visibilitychange", () => {
      if (xr.visibilityState === "hidden") this.#report("asleep");
    });
    this.#stage.rest(true);
    this.#announce();
    const frame = (time, at) => {
      if (this.#xr !== xr) return;
      xr.requestAnimationFrame(frame);
      this.#draw(time, at);
    };
    xr.requestAnimationFrame(frame);
    this.on_change();
  }

  take_off() {
    this.#xr?.end();
  }

  choose_parts(parts) {
    this.parts = parts;
    localStorage.setItem("limn.glasses.parts", parts);
  }

  choose_marker(marker) {
    this.marker = marker;
    this.#announce();
  }

  #announce() {
    if (!this.is_on) return;
    this.#problem = "";
    this.#has_camera = Boolean(this.#view.camera);
    this.#link.send({ type: "glasses", on: true, camera: this.#has_camera, ...(this.marker ? { marker: this.marker } : {}) });
  }

  #report(is) {
    if (this.is_on && this.#place) this.#link.send({ type: "glasses_state", is });
    this.on_change();
  }

  #ended() {
    if (this.is_on) this.#link.send({ type: "glasses", on: false });
    this.#xr = this.#space = this.#place = this.#parts = null;
    this.#view?.close();
    this.#view = null;
    this.#problem = "";
    this.#sent_at = 0;
    this.#is_tracking = true;
    this.#is_fetching = false;
    this.#placed_at = null;
    this.#stage.rest(false);
    this.on_change();
  }

  #take_place(place) {
    if (!this.is_on) return;
    this.#place = place;
    this.#problem = "";
    this.on_change();
  }

  // A place from before a lost connection may be outdated.
  #lose_link() {
    if (this.#link.status !== "connected") this.#place = null;
    if (this.is_on) this.on_change();
  }

  #take_refusal(why) {
    if (!this.is_on || !why.startsWith("glasses")) return;
    this.#problem = why;
    this.on_change();
  }

  #draw(time, frame) {
    const pose = frame.getViewerPose(this.#space);
    // Some browsers give frames to a hidden session, too.
    const is_hidden = this.#xr.visibilityState === "hidden";
    const is_tracking = Boolean(pose) && !pose.emulatedPosition && !is_hidden;
    if (is_tracking !== this.#is_tracking) {
      this.#is_tracking = is_tracking;
      if (!is_tracking) this.#report(is_hidden ? "asleep" : "lost");
      this.on_change();
    }
    const at = frame.predictedDisplayTime ?? time;
    const is_pictured = is_tracking && this.#take_picture(time, at, pose);
    if (is_tracking && (is_pictured || time - this.#sent_at >= k_pose_interval_ms)) {
      this.#sent_at = time;
      this.#send_pose(at, pose.transform);
    }
    const place = is_tracking && this.#place?.state === "registered" ? this.#place : null;
    if (place) this.#placed_at ??= time;
    const is_note_due = place && time - this.#placed_at < k_note_ms;
    this.#view.draw(frame, pose, {
      space: this.#space,
      world_from_feed: place?.world_from_feed ?? null,
      parts: this.#parts,
      mode: this.parts,
      slots: this.#session.state?.slots ?? [],
      words: this.words || (is_note_due ? this.note : ""),
    });
    if (this.#view.is_fetching === this.#is_fetching) return;
    this.#is_fetching = this.#view.is_fetching;
    this.on_change();
  }

  // Without a marker on the glasses Limn needs pictures of their camera. True: one is taken in this frame.
  #take_picture(time, at, pose) {
    if (this.#has_camera && !this.#view.camera) this.#announce(); // the frames have no camera
    if (this.#place?.marker !== "camera" || !this.#view.camera) return false;
    if (!this.#view.camera.constructor.may_send(this.#link.waiting_bytes)) return false;
    const xr = this.#xr;
    return this.#view.camera.take(time, pose, (message, bytes) => {
      if (this.#xr !== xr || this.#place?.marker !== "camera") return;
      this.#link.send({ ...message, at_s: seconds(at) });
      this.#link.send(bytes);
    });
  }

  #send_pose(time, { orientation: q, position: p }) {
    if (!this.#place && !this.#parts && this.#problem) return; // Limn has refused these glasses
    const rounded = (values) => values.map((value) => Number(value.toFixed(6)));
    this.#link.send({
      type: "glasses_pose",
      at_s: seconds(time),
      rotation_wxyz: rounded([q.w, q.x, q.y, q.z]),
      translation_m: rounded([p.x, p.y, p.z]),
    });
  }
}

function make_choice(owner, label, values, chosen, choose) {
  const buttons = values.map(([value, words]) =>
    h(
      "button",
      {
        type: "button",
        "data-glasses-parts": value,
        onclick: () => {
          choose(value);
          show();
        },
      },
      words,
    ),
  );
  const show = () => {
    for (const button of buttons)
      button.setAttribute("aria-pressed", String(button.dataset.glassesParts === chosen()));
  };
  show();
  return h("div", { class: "choices", role: "group", "aria-label": label }, ...buttons);
}

function words_when_registered(owner) {
  const fetching = owner.is_fetching ? "The parts are being fetched …" : "";
  return ["The glasses know where they are in the room.", owner.note, fetching].filter(Boolean).join(" ");
}

export function make_glasses(session, stage) {
  const owner = new Glasses(session, stage);
  const why = h("p", { role: "status", class: "soft", id: "glasses-why" });
  const words = h("span", {}, "Put the glasses on");
  const button = h("button", { type: "button", class: "grow", id: "glasses", hidden: true }, icon("window"), words);
  const choice = make_choice(
    owner,
    "What the glasses draw",
    k_parts,
    () => owner.parts,
    (parts) => owner.choose_parts(parts),
  );
  const marker = h("select", { "aria-label": "The marker on the glasses", hidden: true });
  marker.addEventListener("change", () => owner.choose_marker(marker.value));
  choice.hidden = true;
  by_id("window").append(h("div", { class: "stack" }, h("h3", {}, "Glasses"), why, choice, marker, button));
  owner.on_change = () => {
    set_text(words, owner.is_on ? "Take the glasses off" : "Put the glasses on");
    set_text(why, owner.is_on ? owner.words || words_when_registered(owner) : "");
    why.dataset.state = owner.state;
    marker.hidden = owner.markers.length < 2;
    if (marker.options.length !== owner.markers.length)
      marker.replaceChildren(...owner.markers.map((name) => h("option", { value: name }, name_of(name))));
  };
  button.addEventListener("click", () => {
    if (owner.is_on) return owner.take_off();
    button.disabled = true; // until the glasses have started
    owner
      .put_on()
      .catch((refusal) => set_text(why, k_refusals[refusal.name] ?? `The glasses did not start: ${refusal.message}`))
      .finally(() => (button.disabled = false));
  });
  const check = async () => {
    const reason = await why_no_glasses();
    set_text(why, reason);
    button.hidden = choice.hidden = reason !== "";
  };
  check();
  navigator.xr?.addEventListener?.("devicechange", check);
  return { show() {} };
}
