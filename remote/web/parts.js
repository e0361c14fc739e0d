// The panel Parts: for each slot its variants, the pose and material of its part, its marker, comments.
import { make_comments } from "/comments.js";
import { by_id, h, icon, keep, set_text } from "/dom.js";
import { show_picture } from "/pictures.js";
import { make_material, make_window } from "/shading.js";

const k_steps_mm = ["0.1", "1", "5"];
const k_units = ["mm", "cm", "m", "in", "ft"];
const k_tracking = { seen: "seen", "carried on": "predicted", lost: "not seen" };

const part_url = (slot, variant) => `/picture/variant/${encodeURIComponent(slot)}/${encodeURIComponent(variant)}.png`;

/** A badge with a marker's tracking state, distinguished by word, colour and shape. */
export function tracking_badge() {
  const badge = h("span", { class: "badge" });
  badge.show = (sight) => {
    badge.dataset.sight = sight;
    set_text(badge, k_tracking[sight] ?? sight);
  };
  return badge;
}

function make_variants(session, slot) {
  const strip = h("div", { class: "strip", role: "group", "aria-label": `Variants of ${slot.name}` });
  strip.show = (state_of) => {
    keep(
      strip,
      state_of.variants,
      (name) => name,
      (name) => {
        const canvas = h("canvas", { class: "thumb", "aria-hidden": "true", width: "4", height: "4" });
        const button = session.button(
          "choose_variant",
          { slot: slot.name, value: name, class: "card", "data-stays": "" },
          canvas,
          h("span", {}, name),
        );
        button.update = () => show_picture(canvas, part_url(slot.name, name));
        return button;
      },
    );
    for (const card of strip.children) card.setAttribute("aria-pressed", String(card.key === state_of.variant));
  };
  return strip;
}

function make_nudge(session, slot) {
  let step = "1";
  const steps = h("div", { class: "choices", role: "group", "aria-label": "Step" });
  for (const mm of k_steps_mm)
    steps.append(
      h("button", { type: "button", "aria-pressed": String(mm === step), onclick: () => choose(mm) }, `${mm} mm`),
    );
  function choose(mm) {
    step = mm;
    for (const button of steps.children)
      button.setAttribute("aria-pressed", String(button.textContent === `${mm} mm`));
  }
  const move = (axis, sign, picture) => {
    const value = () => [0, 1, 2].map((i) => (i === axis ? `${sign}${step}` : "0")).join(" ");
    const name = `${sign === "-" ? "−" : "+"}${"xyz"[axis]}`;
    return session.button(
      "nudge",
      {
        slot: slot.name,
        value,
        class: `move ${"xyz"[axis]}${sign === "-" ? "minus" : "plus"}`,
        "aria-label": `Nudge ${slot.name} along ${name}`,
      },
      icon(picture),
      h("span", {}, name),
    );
  };
  const readout = h("p", { class: "readout", "aria-label": "Nudged by, millimetres" });
  const pad = h(
    "div",
    { class: "pad" },
    move(1, "", "up"),
    move(0, "-", "left"),
    readout,
    move(0, "", "right"),
    move(1, "-", "down"),
    move(2, "", "up"),
    move(2, "-", "down"),
  );
  const keys = {
    ArrowUp: ".yplus",
    ArrowDown: ".yminus",
    ArrowLeft: ".xminus",
    ArrowRight: ".xplus",
    PageUp: ".zplus",
    PageDown: ".zminus",
  };
  pad.addEventListener("keydown", (event) => {
    if (!keys[event.key]) return;
    event.preventDefault();
    pad.querySelector(keys[event.key]).click();
  });
  const release = session.button(
    "release",
    { slot: slot.name, class: "wide" },
    icon("release"),
    "Follow the marker again",
  );
  const node = h("div", { class: "stack", "data-needs": "work" }, h("h3", {}, "Nudge"), steps, pad, release);
  node.show = (state_of) => {
    const mm = state_of.nudge_mm.map((v) => v.toFixed(1).replace("-", "−"));
    set_text(readout, `x ${mm[0]}\ny ${mm[1]}\nz ${mm[2]}`);
    release.disabled = !state_of.is_held && state_of.nudge_mm.every((v) => Math.abs(v) < 1e-6);
  };
  return node;
}

// The part's position on the prototype in numbers; its rotation is kept.
function make_place(session, slot) {
  const numbers = ["x", "y", "z"].map((axis) =>
    h("input", {
      type: "number",
      step: "0.1",
      min: "-5000",
      max: "5000",
      inputmode: "decimal",
      "aria-label": `${slot.name}: ${axis} on the prototype, mm`,
    }),
  );
  let turn = [1, 0, 0, 0];
  const set = session.button(
    "place",
    { slot: slot.name, value: () => [...numbers.map((number) => number.value || "0"), ...turn].join(" ") },
    "Set",
  );
  const node = h(
    "div",
    { class: "stack", "data-needs": "work" },
    h("h3", {}, "Place on the prototype: x, y, z in mm"),
    h("div", { class: "line" }, ...numbers, set),
  );
  node.show = (state_of) => {
    const pose = state_of.prototype_from_part;
    if (!pose || node.contains(document.activeElement)) return;
    turn = pose.rotation_wxyz;
    numbers.forEach((number, i) => (number.value = (1000 * pose.translation_m[i]).toFixed(1)));
  };
  return node;
}

function make_marker(session, slot) {
  const words = h("p", { class: "soft" });
  const waiting = h("div", { class: "stack" });
  const none = h(
    "p",
    { class: "soft small" },
    "To use another marker, lay it down and keep it still for a second.",
  );
  const own = session.button("unpair", { slot: slot.name, class: "wide" }, "Use its own marker again");
  const node = h(
    "div",
    { class: "stack" },
    h("h3", {}, "Marker"),
    words,
    h("div", { class: "stack", "data-needs": "operate" }, waiting, none, own),
  );
  node.show = (state_of, markers) => {
    set_text(
      words,
      `Carried by ${state_of.marker}.${state_of.is_held ? " The part stays where it was placed until its marker moves." : ""}`,
    );
    keep(
      waiting,
      markers,
      (name) => name,
      (name) => session.button("pair", { slot: slot.name, value: name, class: "wide" }, `Use marker ${name}`),
    );
    none.hidden = markers.length > 0;
  };
  return node;
}

function make_units(session, slot) {
  const variant = h("select", { "aria-label": "Variant whose unit is wrong" });
  const unit = h("select", { "aria-label": "Its unit" }, ...k_units.map((name) => h("option", {}, name)));
  const set = session.button("units", { slot: slot.name, value: () => `${variant.value} ${unit.value}` }, "Set");
  const node = h(
    "div",
    { class: "stack", "data-needs": "operate" },
    h("h3", {}, "Unit of an added part"),
    h("div", { class: "line" }, variant, unit, set),
  );
  node.show = (state_of) => {
    const dropped = state_of.dropped ?? [];
    node.hidden = !dropped.length;
    keep(
      variant,
      dropped,
      (name) => name,
      (name) => h("option", {}, name),
    );
  };
  return node;
}

function make_slot(session, slot) {
  const picture = h("canvas", { class: "thumb", "aria-hidden": "true", width: "4", height: "4" });
  const variant = h("span", { class: "soft" });
  const sight = tracking_badge();
  const id = `more-${slot.name}`;
  const more = h("div", { class: "more stack", id, hidden: true });
  const head = h(
    "button",
    { type: "button", class: "open", "aria-expanded": "false", "aria-controls": id },
    picture,
    h("span", { class: "name" }, h("b", {}, slot.name), variant, sight),
    icon("more"),
  );
  const node = h(
    "article",
    { class: "slot", "aria-label": `Part ${slot.name}` },
    h(
      "div",
      { class: "head" },
      session.button(
        "previous_variant",
        { slot: slot.name, class: "step", "aria-label": `Previous variant of ${slot.name}` },
        icon("previous"),
      ),
      head,
      session.button(
        "next_variant",
        { slot: slot.name, class: "step", "aria-label": `Next variant of ${slot.name}` },
        icon("next"),
      ),
    ),
    more,
  );
  const comments = make_comments(session, () => ({ look: "", slot: slot.name }), `Comment on ${slot.name}`);
  const pieces = [
    make_variants(session, slot),
    make_nudge(session, slot),
    make_place(session, slot),
    make_material(session, slot),
    make_window(session, slot),
    make_marker(session, slot),
    make_units(session, slot),
  ];
  more.append(...pieces, h("h3", {}, "Comments"), comments);
  let latest;
  const fill = () => {
    for (const piece of pieces) piece.show(latest.slot, latest.state.waiting);
    comments.show(latest.state.comments.filter((c) => c.slot === slot.name));
  };
  node.open = (is_open) => {
    head.setAttribute("aria-expanded", String(is_open));
    more.hidden = !is_open;
    if (is_open) fill();
  };
  head.addEventListener("click", () => node.open(more.hidden));
  node.show = (state, state_of) => {
    latest = { state, slot: state_of };
    set_text(variant, state_of.variant);
    sight.show(state_of.sight);
    show_picture(picture, part_url(slot.name, state_of.variant));
    if (!more.hidden) fill();
  };
  return node;
}

// A marker that lies still and carries no part is offered to all slots.
function make_offer(session) {
  const words = h("p", {});
  const slots = h("div", { class: "strip" });
  const node = h("div", { class: "offer stack", "data-needs": "operate", hidden: true }, words, slots);
  node.show = (state) => {
    const marker = state.waiting[0];
    node.hidden = !marker;
    if (!marker) return;
    set_text(words, `Marker ${marker} lies still and carries no part. Choose a part for it:`);
    keep(
      slots,
      state.slots,
      (slot) => `${slot.name} ${marker}`,
      (slot) => session.button("pair", { slot: slot.name, value: marker }, slot.name),
    );
  };
  return node;
}

export function make_parts(session) {
  const offer = make_offer(session);
  const role = h(
    "p",
    { class: "soft small", "data-role-only": "look" },
    "You can only watch. To make changes, leave (in the panel Room) and pair again with the PIN for work.",
  );
  const list = h("div", { class: "slots" });
  by_id("parts").append(h("h2", {}, "Parts"), role, offer, list);
  let is_first = true;
  return {
    show(state) {
      offer.show(state);
      keep(
        list,
        state.slots,
        (slot) => slot.name,
        (slot) => make_slot(session, slot),
      );
      for (const slot of state.slots) [...list.children].find((node) => node.key === slot.name).show(state, slot);
      if (is_first && list.children.length && matchMedia("(min-width: 1100px)").matches)
        list.firstElementChild.open(true);
      is_first = false;
    },
  };
}
