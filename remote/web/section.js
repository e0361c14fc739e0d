// The section: a marker's plane that cuts parts open.
import { h } from "/dom.js";
import { make_switch } from "/stage.js";

/** Switches it on, holds its plane and exchanges its sides; hidden in a scene without a section. */
export function make_section(session) {
  const is_on = make_switch(
    session,
    "section",
    (state) => Boolean(state.section?.is_on),
    h("span", {}, "Section", h("small", {}, "a marker cuts parts open")),
  );
  const hold = session.button(
    "section",
    { value: () => (session.state.section.is_held ? "release" : "hold") },
    h("span", {}, "Hold the plane"),
  );
  const flip = session.button("section", { value: "flip" }, h("span", {}, "Other side"));
  const node = h(
    "div",
    { class: "stack", "data-needs": "work", hidden: true },
    is_on,
    h("div", { class: "choices" }, hold, flip),
  );
  node.show = (state) => {
    node.hidden = !state.section;
    if (node.hidden) return;
    is_on.show(state);
    hold.setAttribute("aria-pressed", String(state.section.is_held));
  };
  return node;
}
