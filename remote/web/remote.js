// The remote's page: the live image, and panels with controls.
import { by_id, h, icon } from "/dom.js";
import { make_glasses } from "/glasses.js";
import { make_light } from "/light.js";
import { make_looks } from "/looks.js";
import { make_parts } from "/parts.js";
import { make_room } from "/room.js";
import { begin_session } from "/session.js";
import { make_stage } from "/stage.js";
import { make_window } from "/window.js";

const k_tabs = [
  ["parts", "Parts"],
  ["looks", "Looks"],
  ["light", "Light"],
  ["window", "Window"],
  ["people", "Room"],
];

const session = begin_session({
  purpose: "Type the PIN that the operator's window shows, or scan its QR code.",
  name_hint: "others see it beside your changes",
  on_state: (state) => {
    for (const panel of panels) panel.show(state);
    if (!performance.getEntriesByName("ready").length) performance.mark("ready");
  },
});
const stage = make_stage(session);
const panels = [
  stage,
  make_parts(session),
  make_looks(session),
  make_light(session),
  make_window(session, stage),
  make_glasses(session, stage),
  make_room(session),
];

function choose_tab(name) {
  document.body.dataset.tab = name;
  for (const button of by_id("tabs").children)
    if (button.dataset.tab === name) button.setAttribute("aria-current", "page");
    else button.removeAttribute("aria-current");
  for (const node of [by_id("panels"), by_id(name)]) node.scrollTop = 0;
  for (const panel of panels) panel.opened?.(name);
}

for (const [name, label] of k_tabs)
  by_id("tabs").append(
    h(
      "button",
      { type: "button", "data-tab": name, onclick: () => choose_tab(name) },
      icon(name === "people" ? "room" : name),
      h("span", {}, label),
    ),
  );
choose_tab("parts");
// On a desktop screen the looks are always visible and have no tab.
const desk = matchMedia("(min-width: 1280px) and (min-height: 720px)");
desk.addEventListener("change", () => desk.matches && document.body.dataset.tab === "looks" && choose_tab("parts"));
if (navigator.serviceWorker) navigator.serviceWorker.register("/service-worker.js").catch(() => {});
performance.mark("usable");
