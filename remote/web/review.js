// The review page: images of looks, the parts in 3D, comments on looks and parts; printed, it is a contact sheet.
import { make_comments } from "/comments.js";
import { by_id, h, keep, set_text } from "/dom.js";
import { read_glb } from "/glb.js";
import { look_url, Saves } from "/looks.js";
import { show_picture } from "/pictures.js";
import { begin_session } from "/session.js";
import { View3d } from "/view3d.js";

const saves = new Saves();
const session = begin_session({
  purpose: "To see the looks, type the PIN that the operator's window shows, or scan its QR code.",
  name_hint: "others see it beside your comments",
  on_state: show,
});
const solid = by_id("solid");
let view = null;

function make_card(look) {
  const canvas = h("canvas", { role: "img", "aria-label": `Look ${look}`, width: "16", height: "10" });
  const open = h("button", { type: "button", onclick: () => open_solid(look) }, "3D view");
  const part = h("select", { "aria-label": `What a comment on ${look} is about`, "data-needs": "work" });
  const comments = make_comments(session, () => ({ look, slot: part.value }), `Comment on ${look}`);
  comments.insertBefore(part, comments.lastElementChild);
  const node = h(
    "article",
    { class: "sheet-card stack", "aria-label": `Look ${look}` },
    canvas,
    h("div", { class: "line" }, h("h2", { class: "grow" }, look), open),
    comments,
  );
  node.show = (state) => {
    show_picture(canvas, look_url(look), saves.stamp(look));
    const slots = [{ name: "" }, ...state.slots];
    keep(
      part,
      slots,
      (slot) => slot.name,
      (slot) => h("option", { value: slot.name }, slot.name || "the whole look"),
    );
    comments.show(state.comments.filter((comment) => comment.look === look));
  };
  return node;
}

const rest = make_comments(session, () => ({ look: "", slot: "" }), "General comment");
by_id("all").append(rest);

function show(state) {
  saves.take(state);
  by_id("no-looks").hidden = state.looks.length > 0;
  keep(by_id("cards"), state.looks, (look) => look, make_card);
  for (const card of by_id("cards").children) card.show(state);
  rest.show(state.comments.filter((comment) => !state.looks.includes(comment.look)));
  if (!performance.getEntriesByName("ready").length) performance.mark("ready");
}

function mark(name) {
  for (const button of by_id("solid-parts").children)
    button.setAttribute("aria-pressed", String(button.key === name));
  view.mark(name);
}

async function open_solid(look) {
  set_text(by_id("solid-name"), look);
  set_text(by_id("solid-why"), "Loading …");
  by_id("solid-parts").replaceChildren();
  solid.showModal();
  try {
    view ??= new View3d(solid.querySelector("canvas"));
    view.show([]);
    const answer = await fetch(`/look/${encodeURIComponent(look)}.glb`, { cache: "no-store" });
    if (!answer.ok)
      throw new Error((await answer.json().catch(() => ({}))).error ?? `Limn could not send the look (${answer.status}). Try again.`);
    const meshes = await read_glb(await answer.arrayBuffer());
    view.show(meshes);
    const parts = session.state.slots
      .flatMap(({ name, variants }) => variants.map((variant) => [`${name} ${variant}`, name]))
      .filter(([node]) => meshes.some((mesh) => mesh.name === node));
    let marked = "";
    keep(
      by_id("solid-parts"),
      parts,
      ([node]) => node,
      ([node, name]) =>
        h(
          "button",
          { type: "button", "aria-pressed": "false", onclick: () => mark((marked = marked === node ? "" : node)) },
          name,
        ),
    );
    mark("");
    set_text(by_id("solid-why"), "Turn it by dragging or with the arrow keys; zoom with two fingers.");
  } catch (reason) {
    set_text(by_id("solid-why"), reason.message);
  }
}

by_id("solid-close").addEventListener("click", () => solid.close());
by_id("print").addEventListener("click", () => print());
performance.mark("usable");
