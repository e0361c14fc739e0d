// Material of parts, window of volumes, finish and lines of the prototype, and room light: sliders that act when they are released.
import { h, keep } from "/dom.js";

function slider(label, properties) {
  const input = h("input", { type: "range", ...properties, "aria-label": label });
  return { input, row: h("div", { class: "line named" }, h("span", { class: "soft" }, properties.title ?? label), input) };
}

const share = (label, title, value) => slider(label, { title, min: "0", max: "1", step: "0.05", value });

/**
 * Calls `send` when an input is released. Returns a function that sets the inputs to the session's text: one word for each input,
 * in their order, where `-` or a missing word means the initial value.
 */
function let_go(inputs, send) {
  const first = inputs.map((input) => input.value);
  let is_held = false;
  for (const input of inputs) {
    input.addEventListener("input", () => (is_held = true));
    input.addEventListener("change", async () => {
      is_held = true;
      await send();
      is_held = false;
    });
  }
  return (text) => {
    if (is_held) return;
    const words = text.split(" ");
    inputs.forEach((input, i) => (input.value = !words[i] || words[i] === "-" ? first[i] : words[i]));
  };
}

/** Controls for a part's material override: colour, metalness and roughness. */
export function make_material(session, slot) {
  const colour = h("input", { type: "color", value: "#808080", "aria-label": `Colour of ${slot.name}` });
  const metal = share(`Metalness of ${slot.name}`, "Metal", "0"),
    rough = share(`Roughness of ${slot.name}`, "Rough", "0.5");
  const words = () => `${colour.value} ${metal.input.value} ${rough.input.value}`;
  const follow = let_go([colour, metal.input, rough.input], () => session.act("material", slot.name, words()));
  const node = h(
    "div",
    { class: "stack", "data-needs": "work" },
    h("h3", {}, "Material"),
    h("div", { class: "line named" }, h("span", { class: "soft" }, "Colour"), colour),
    metal.row,
    rough.row,
    session.button("material", { slot: slot.name, class: "wide" }, "Use the file's material"),
  );
  node.show = (state_of) => follow(state_of.material);
  return node;
}

/** Controls for the window of a part's volume: which values are black and white. Hidden for a mesh. */
export function make_window(session, slot) {
  const number = (label, title) => slider(`${label} of ${slot.name}`, { title, min: "0", max: "1", step: "any", value: "0" });
  const level = number("Level", "Level"),
    width = number("Width", "Width");
  const follow = let_go([width.input, level.input], () =>
    session.act("window", slot.name, `${Number(width.input.value)} ${Number(level.input.value)}`),
  );
  const node = h(
    "div",
    { class: "stack", "data-needs": "work", hidden: true },
    h("h3", {}, "Window"),
    level.row,
    width.row,
    session.button("window", { slot: slot.name, class: "wide" }, "Use the file's window"),
  );
  node.show = ({ volume }) => {
    node.hidden = !volume;
    if (!volume) return;
    const range = volume.most - volume.least || 1;
    Object.assign(level.input, { min: volume.least, max: volume.most });
    Object.assign(width.input, { min: range / 1000, max: range });
    follow(volume.window);
  };
  return node;
}

/** The choice of the whole prototype's finish; hidden in a scene without finishes. */
export function make_finish(session) {
  const choice = h("select", { "aria-label": "Finish of the prototype", "data-action": "finish" });
  choice.addEventListener("change", () => session.act("finish", "", choice.value));
  const node = h("div", { class: "stack", "data-needs": "work", hidden: true }, h("h3", {}, "Finish"), choice);
  node.show = ({ finishes = [], finish = "" }) => {
    node.hidden = finishes.length === 0;
    const names = ["", ...finishes];
    if (names.join("\n") !== [...choice.options].map(({ value }) => value).join("\n"))
      choice.replaceChildren(...names.map((name) => h("option", { value: name }, name || "Bare prototype")));
    if (choice.value !== finish) choice.value = finish;
  };
  return node;
}

/** A switch for each line of light on the prototype. */
export function make_lines(session) {
  const list = h("div", { class: "choices wrap" });
  const node = h("div", { class: "stack", "data-needs": "work", "data-action": "line", hidden: true }, h("h3", {}, "Lines"), list);
  const is_on = (name) => (session.state?.lines_on ?? []).includes(name);
  node.show = ({ lines = [], lines_on = [] }) => {
    node.hidden = lines.length === 0;
    keep(
      list,
      lines,
      (name) => name,
      (name) =>
        session.button("line", { slot: name, value: () => (is_on(name) ? "off" : "on"), "data-line": name }, name),
    );
    for (const button of list.children) button.setAttribute("aria-pressed", String(lines_on.includes(button.key)));
  };
  return node;
}

/** Controls for the room light that parts are shaded with, instead of the scene's own. */
export function make_shading(session) {
  const strength = { min: "0", max: "2", step: "0.05" };
  const lights = [
    slider("Lamp, degrees to the right", { title: "Right", min: "-180", max: "180", step: "5", value: "30" }),
    slider("Lamp, degrees up", { title: "Up", min: "-90", max: "90", step: "5", value: "45" }),
    slider("Lamp's strength", { title: "Lamp", ...strength, value: "0.6" }),
    slider("Soft light from above", { title: "Above", ...strength, value: "0.3" }),
    slider("Soft light from below", { title: "Below", ...strength, value: "0.1" }),
  ];
  const words = () => lights.map(({ input }) => input.value).join(" ");
  const follow = let_go(
    lights.map(({ input }) => input),
    () => session.act("light", "", words()),
  );
  const node = h(
    "div",
    { class: "stack", "data-needs": "work" },
    h("h3", {}, "Light on the parts"),
    ...lights.map(({ row }) => row),
    session.button("light", { class: "wide" }, "Use the scene's own light"),
  );
  node.show = (state) => state.light !== "other" && follow(state.light);
  return node;
}
