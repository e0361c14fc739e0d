// The panel Light: grid, split, viewer, screens, room light, projector images.
import { role_of } from "/actions.js";
import { by_id, h, icon, keep, set_text } from "/dom.js";
import { draw_picture, fetch_picture } from "/pictures.js";
import { make_deviation } from "/deviation.js";
import { make_pen } from "/pen.js";
import { make_section } from "/section.js";
import { make_finish, make_lines, make_shading } from "/shading.js";
import { make_switch } from "/stage.js";

const k_screens = {
  rest: "what light cannot show",
  full: "whole parts",
  camera: "camera image only",
  view: "the viewer's view",
  stereo: "stereo pair",
  off: "nothing",
};
const k_every_ms = 700; // interval between images of a projector, while the panel is open
const k_reach_mm = 300; // range of the slider; the number field allows more

function make_split(session) {
  const is_on = make_switch(
    session,
    "split",
    (s) => s.split,
    icon("split"),
    h("span", {}, "Split", h("small", {}, "previous look left of a line")),
  );
  const slider = h("input", {
    type: "range",
    min: -k_reach_mm,
    max: k_reach_mm,
    step: "1",
    "aria-label": "Position of the split, mm right of the middle",
    "data-action": "split_at",
  });
  const number = h("input", {
    type: "number",
    step: "1",
    min: "-5000",
    max: "5000",
    "aria-label": "Position of the split, mm",
    "data-action": "split_at",
    inputmode: "decimal",
  });
  const where = h("div", { class: "line" }, slider, number, h("span", { class: "soft" }, "mm"));
  let is_sent = false,
    wanted = null;
  // Only one edit is in flight: a drag sends its newest position when the last edit is done.
  const move = async (mm) => {
    wanted = mm;
    if (is_sent) return;
    is_sent = true;
    while (wanted !== null) {
      const value = wanted;
      wanted = null;
      if (!(await session.act("split_at", "", value))) break;
    }
    is_sent = false;
  };
  slider.addEventListener("input", () => move(slider.value));
  number.addEventListener("change", () => number.value !== "" && move(number.value));
  const node = h("div", { class: "stack" }, is_on, where);
  node.show = (state) => {
    is_on.show(state);
    is_on.disabled = !state.split && !state.other_look;
    is_on.title = is_on.disabled ? "Save or show two looks first." : "";
    where.hidden = !state.split;
    if (is_sent) return;
    slider.value = state.split_mm;
    if (document.activeElement !== number) number.value = state.split_mm;
  };
  return node;
}

const k_own = "\n"; // the key of the scene's own viewer; no guest can have this name

// The choice of the viewer that `view` parts are drawn for: guests whose windows are open, and the chosen one even if its
// window sees no markers.
function make_viewers(session) {
  const list = h("div", { class: "choices wrap", role: "group", "aria-label": "The viewer that view parts are drawn for" });
  const node = h(
    "div",
    { class: "stack", "data-action": "viewer", "data-needs": role_of("viewer") },
    h("h3", {}, "View parts are drawn for"),
    list,
  );
  const make = (name) =>
    name === k_own
      ? session.button("viewer", { value: "" }, h("span", {}, "the scene's own viewer", h("small")))
      : session.button("viewer", { value: name }, h("span", {}, `${name}'s tablet`, h("small")));
  node.show = (state) => {
    const names = [k_own, ...new Set([...state.windows, state.viewer].filter(Boolean))];
    keep(list, names, (name) => name, make);
    for (const button of list.children) {
      const is_chosen = button.key === (state.viewer || k_own);
      button.setAttribute("aria-pressed", String(is_chosen));
      const waits = is_chosen && state.viewer && state.follows !== state.viewer;
      set_text(button.querySelector("small"), button.key === k_own ? "" : waits ? "sees no markers now" : "");
    }
  };
  return node;
}

function make_projector(name) {
  const canvas = h("canvas", {
    role: "img",
    "aria-label": `What ${name} shows`,
    width: "8",
    height: "5",
    "data-projector": name,
  });
  const figure = h("figure", {}, canvas, h("figcaption", {}, name));
  let is_asked = false; // only one request at a time, however slow the network is
  figure.refresh = async () => {
    if (is_asked) return;
    is_asked = true;
    const picture = await fetch_picture(`/picture/projector/${encodeURIComponent(name)}.jpg`);
    if (picture) draw_picture(canvas, picture);
    is_asked = false;
  };
  return figure;
}

function make_projectors(session) {
  const list = h("div", { class: "projectors" });
  let is_open = false,
    edit_number;
  const refresh = () => {
    if (!is_open || document.hidden || session.link.status !== "connected") return;
    for (const figure of list.children) figure.refresh();
  };
  setInterval(refresh, k_every_ms);
  list.opened = (name) => {
    is_open = name === "light";
    refresh();
  };
  list.show = (state) => {
    keep(list, state.projectors, (name) => name, make_projector);
    if (state.last_edit?.number === edit_number) return;
    edit_number = state.last_edit?.number;
    refresh();
  };
  return list;
}

// The choice for one of several screens; the buttons above choose for all of them.
function make_output(session, name, screens) {
  const choice = h(
    "select",
    { "aria-label": `What ${name} shows`, "data-action": "screen", "data-output": name },
    ...screens.map((what) => h("option", { value: what }, what)),
  );
  choice.addEventListener("change", async () => {
    if (await session.act("screen", name, choice.value)) return;
    choice.value = session.state.outputs.find((output) => output.name === name)?.shows ?? choice.value;
  });
  const node = h("div", { class: "line named" }, h("span", { class: "soft" }, name), choice);
  node.choice = choice;
  return node;
}

export function make_light(session) {
  const grid = make_switch(
    session,
    "grid",
    (s) => s.grid,
    icon("grid"),
    h("span", {}, "Grid", h("small", {}, "lines every 10 mm")),
  );
  const rings = make_switch(
    session,
    "marker_states",
    (s) => s.marker_states,
    icon("rings"),
    h("span", {}, "Marker states", h("small", {}, "green: seen, amber: predicted")),
  );
  const split = make_split(session);
  const screens = h("div", { class: "choices wrap", role: "group", "aria-label": "What screens show" });
  const outputs = h("div", { class: "stack" });
  const shading = make_shading(session),
    finish = make_finish(session),
    section = make_section(session),
    lines = make_lines(session),
    deviation = make_deviation(session),
    pen = make_pen(session);
  const viewers = make_viewers(session);
  const projectors = make_projectors(session);
  by_id("light").append(
    h("h2", {}, "Light"),
    h(
      "div",
      { class: "stack", "data-needs": "work" },
      h("div", { class: "pair" }, grid, rings),
      split,
      viewers,
      h(
        "div",
        { class: "stack", "data-action": "screen", "data-needs": role_of("screen") },
        h("h3", {}, "Screens"),
        screens,
        outputs,
      ),
      section,
      finish,
      lines,
      pen,
      deviation,
      shading,
    ),
    h("h3", {}, "Projectors"),
    projectors,
  );
  return {
    opened: (name) => projectors.opened(name),
    show(state) {
      for (const part of [grid, rings, split, viewers, section, finish, lines, pen, deviation, shading, projectors])
        part.show(state);
      keep(
        screens,
        state.screens,
        (name) => name,
        (name) =>
          session.button("screen", { value: name }, h("span", {}, name, h("small", {}, k_screens[name] ?? ""))),
      );
      const shown = state.outputs.length ? state.outputs.map((output) => output.shows) : [state.screen];
      for (const button of screens.children)
        button.setAttribute("aria-pressed", String(shown.every((what) => what === button.key)));
      const several = state.outputs.length > 1 ? state.outputs : [];
      keep(
        outputs,
        several,
        (output) => output.name,
        (output) => make_output(session, output.name, state.screens),
      );
      several.forEach((output, i) => (outputs.children[i].choice.value = output.shows));
    },
  };
}
