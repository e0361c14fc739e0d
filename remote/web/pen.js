// The pen: lines of light are drawn on the prototype through the live image, and changed.
import { role_of } from "/actions.js";
import { by_id, h } from "/dom.js";

const k_every_ms = 40; // between the messages of a stroke
const k_most_points = 250; // of a message

// The pixel of a canvas's image under the pointer; the image may be smaller than the canvas's box (object-fit).
function pixel_at(canvas, event) {
  const box = canvas.getBoundingClientRect();
  const scale = Math.min(box.width / canvas.width, box.height / canvas.height);
  const x = (event.clientX - box.left - (box.width - scale * canvas.width) / 2) / scale,
    y = (event.clientY - box.top - (box.height - scale * canvas.height) / 2) / scale;
  return [x - 0.5, y - 0.5]; // pixel (0, 0) is the first one's centre
}

// A stroke while the pointer is down: sends its points as they come.
class Stroke {
  #session;
  #line;
  #canvas;
  #from;
  #points = [];
  #picture = null;
  #sent_at = 0;
  #timer = 0;

  constructor(session, line, canvas, from) {
    this.#session = session;
    this.#line = line;
    this.#canvas = canvas;
    this.#from = from;
  }

  add(event) {
    const picture = Number(this.#from === "room" ? this.#canvas.dataset.picture : this.#canvas.dataset.number);
    if (picture !== this.#picture) this.send(); // points of an image go with that image
    this.#picture = picture;
    for (const each of event.getCoalescedEvents?.() ?? [event]) this.#points.push(pixel_at(this.#canvas, each));
    if (!this.#points.length) this.#points.push(pixel_at(this.#canvas, event));
    const wait = k_every_ms - (performance.now() - this.#sent_at);
    if (wait <= 0 || this.#points.length >= k_most_points) return this.send();
    this.#timer ||= setTimeout(() => this.send(), wait);
  }

  send() {
    clearTimeout(this.#timer);
    this.#timer = 0;
    const px = this.#points.splice(0, k_most_points);
    if (!px.length || !Number.isFinite(this.#picture)) return;
    this.#sent_at = performance.now();
    const { link } = this.#session;
    link
      .stroke({ what: "draw", line: this.#line, from: this.#from, picture: this.#picture, px })
      .catch((refusal) => this.#session.say(refusal.message, true));
  }
}

// Follows a link whose file may not be there (STEP needs limn-cad at the session's machine), and says why.
async function download(event, session) {
  event.preventDefault();
  const link = event.currentTarget;
  const answer = await fetch(link.href).catch(() => null);
  if (!answer?.ok) {
    const refusal = await answer?.json().catch(() => null);
    return session.say(refusal?.error ?? "The session does not answer.", true);
  }
  const href = URL.createObjectURL(await answer.blob());
  h("a", { href, download: link.download }).click();
  setTimeout(() => URL.revokeObjectURL(href), 60000);
}

/** Draws, moves, smooths, renames and removes drawn lines, and saves them to files. */
export function make_pen(session) {
  let mode = "off",
    names = new Set(),
    lines = [];
  const unused_name = () => {
    let number = 1;
    const name = () => `line-${String(number).padStart(2, "0")}`;
    while (names.has(name())) ++number;
    names.add(name());
    return name();
  };

  const last = () => lines.at(-1) ?? "";
  const watch = (canvas, from) => {
    let stroke = null,
      begun = null;
    canvas.addEventListener("pointerdown", (event) => {
      if (mode === "off" || !event.isPrimary) return;
      canvas.setPointerCapture(event.pointerId);
      event.preventDefault();
      if (mode === "draw") {
        stroke = new Stroke(session, unused_name(), canvas, from);
        stroke.add(event);
      } else begun = pixel_at(canvas, event);
    });
    canvas.addEventListener("pointermove", (event) => stroke?.add(event));
    const end = (event) => {
      stroke?.send();
      stroke = null;
      if (begun && event.type === "pointerup") {
        const picture = Number(from === "room" ? canvas.dataset.picture : canvas.dataset.number);
        session.link
          .stroke({ what: "move", line: choice.value, from, picture, px: [begun, pixel_at(canvas, event)] })
          .catch((refusal) => session.say(refusal.message, true));
      }
      begun = null;
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
  };
  watch(by_id("room-picture"), "room");
  watch(by_id("window-picture"), "window");

  const modes = h("div", { class: "choices", role: "group", "aria-label": "What the pen does" });
  const choose = (wanted) => {
    mode = wanted;
    for (const button of modes.children) button.setAttribute("aria-pressed", String(button.dataset.pen === mode));
    by_id("view").style.touchAction = mode === "off" ? "" : "none";
  };
  const make_mode = (value, properties, label) =>
    h("button", { type: "button", "data-pen": value, ...properties, onclick: () => choose(value) }, label);
  modes.append(
    make_mode("off", {}, "No pen"),
    make_mode("draw", { "data-action": "draw_line", "data-needs": role_of("draw_line") }, "Draw"),
    make_mode("move", { "data-action": "move_line", "data-needs": role_of("move_line") }, "Move"),
  );
  choose("off");

  const choice = h("select", { "aria-label": "Drawn line" });
  const name = h("input", { type: "text", maxlength: "60", "aria-label": "New name of the line", placeholder: "New name" });
  const on_chosen = (properties, label) => {
    const button = h("button", { type: "button", ...properties }, label);
    const value = () => (button.dataset.action === "rename_line" ? name.value : "");
    button.addEventListener("click", () => session.act(button.dataset.action, choice.value, value(), button));
    return button;
  };
  const changes = h(
    "div",
    { class: "stack", hidden: true },
    choice,
    h(
      "div",
      { class: "choices wrap" },
      on_chosen({ "data-action": "smooth_line", "data-needs": role_of("smooth_line") }, "Smooth"),
      on_chosen({ "data-action": "erase_line", "data-needs": role_of("erase_line") }, "Remove"),
      h("a", { href: "/api/lines.csv", download: "lines.csv" }, "CSV"),
      h("a", { href: "/api/lines.dxf", download: "lines.dxf" }, "DXF"),
      h("a", { href: "/api/lines.step", download: "lines.step", onclick: (event) => download(event, session) }, "STEP"),
    ),
    h("div", { class: "line named" }, name, on_chosen({ "data-action": "rename_line", "data-needs": role_of("rename_line") }, "Rename")),
  );
  const node = h(
    "div",
    { class: "stack", "data-needs": "work", hidden: true },
    h("h3", {}, "Pen"),
    h("p", { class: "soft" }, "Draw on the live image: the line is light on the prototype."),
    modes,
    changes,
  );
  node.show = (state) => {
    node.hidden = !state.prototype;
    names = new Set([...(state.lines ?? [])]);
    const drawn = state.lines_drawn ?? [];
    const had = last();
    lines = drawn;
    changes.hidden = !drawn.length;
    if (drawn.join("\n") === [...choice.options].map(({ value }) => value).join("\n")) return;
    const chosen = choice.value;
    choice.replaceChildren(...drawn.map((each) => h("option", { value: each }, each)));
    choice.value = had !== last() || !drawn.includes(chosen) ? last() : chosen; // a new stroke is chosen
  };
  return node;
}
