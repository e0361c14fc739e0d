// The panel Looks: saved arrangements with their images; save, show, compare, delete and restore.
import { by_id, h, icon, keep, set_text } from "/dom.js";
import { show_picture } from "/pictures.js";

/** The number of the state in which each look was last saved, so that its image is fetched again after a new save. */
export class Saves {
  #at = new Map();
  take(state) {
    const edit = state.last_edit;
    if (edit?.action === "save_look") this.#at.set(edit.value || state.look, edit.number);
  }
  stamp(look) {
    return this.#at.get(look) ?? "";
  }
}

export const look_url = (look) => `/picture/look/${encodeURIComponent(look)}.png`;

function make_card(session, look) {
  const canvas = h("canvas", { class: "thumb", "aria-hidden": "true", width: "8", height: "5" });
  const name = h("span", {}, look);
  const restore = session.button(
    "restore_look",
    { value: look, class: "card", "data-stays": "", "aria-label": `Show look ${look}` },
    canvas,
    name,
  );
  const remove = session.button(
    "delete_look",
    { value: look, class: "corner", "aria-label": `Delete look ${look}` },
    icon("trash"),
  );
  const node = h("div", { class: "look" }, restore, remove);
  node.show = (state, stamp) => {
    restore.setAttribute("aria-pressed", String(state.look === look));
    show_picture(canvas, look_url(look), stamp);
  };
  return node;
}

export function make_looks(session) {
  const saves = new Saves();
  const none = h(
    "p",
    { class: "soft" },
    "No looks yet. A look saves the variants, positions and materials of all parts, and the light.",
  );
  const back = session.button("undelete_look", { class: "wide" }, icon("undo"), h("span", {}, ""));
  const list = h("div", { class: "looks" });
  const name = h("input", {
    "aria-label": "Name of the look to save",
    placeholder: "Name of a new look",
    maxlength: "64",
    title: "Letters, digits, spaces, -, _ and .",
    pattern: "[A-Za-z0-9_][A-Za-z0-9_. \\-]*",
    enterkeyhint: "done",
  });
  const save = h("button", { class: "main", "data-action": "save_look" }, icon("save"), h("span", {}, "Save"));
  // The button says Replace if a look of that name exists.
  const say_what = () =>
    set_text(save.lastElementChild, session.state?.looks.includes(name.value.trim()) ? "Replace" : "Save");
  name.addEventListener("input", say_what);
  const form = h("form", { class: "line" }, name, save);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (await session.act("save_look", "", name.value.trim(), save)) name.value = "";
    say_what();
  });
  const flip = session.button("flip", { class: "grow" }, icon("flip"), h("span", {}, "Compare"));
  const previous = session.button(
    "previous_look",
    { class: "step", "aria-label": "Previous look" },
    icon("previous"),
  );
  const next = session.button("next_look", { class: "step", "aria-label": "Next look" }, icon("next"));
  const dock = h(
    "div",
    { class: "dock stack", "data-needs": "work" },
    h("div", { class: "line" }, previous, flip, next),
    form,
  );
  by_id("looks").append(h("h2", {}, "Looks"), back, none, list, dock);
  return {
    show(state) {
      saves.take(state);
      none.hidden = state.looks.length > 0;
      keep(
        list,
        state.looks,
        (look) => look,
        (look) => make_card(session, look),
      );
      for (const card of list.children) card.show(state, saves.stamp(card.key));
      back.hidden = !state.deleted_look;
      set_text(back.lastElementChild, `Undelete ${state.deleted_look}`);
      flip.disabled = !state.other_look;
      set_text(flip.lastElementChild, state.other_look ? `Compare with ${state.other_look}` : "Compare");
      flip.title = state.other_look ? "" : "Save or show two looks, then compare them.";
      previous.disabled = next.disabled = !state.looks.length;
    },
  };
}
