// The live image with its status, the last edit, and the switches Freeze and Blackout, which are always visible.
import { in_words } from "/actions.js";
import { by_id, icon, set_text } from "/dom.js";
import { draw_picture } from "/pictures.js";

const k_again_ms = 500; // pause before the next request when there is no image of the room

/** A switch for an on_off action; it shows whether it is on. */
export function make_switch(session, action, is_on, ...children) {
  const button = session.button(
    action,
    { role: "switch", "aria-checked": "false", class: "switch", value: () => (is_on(session.state) ? "off" : "on") },
    ...children,
  );
  button.show = (state) => button.setAttribute("aria-checked", String(is_on(state)));
  return button;
}

export function make_stage(session) {
  const room = by_id("room-picture");
  const blackout = make_switch(session, "blackout", (s) => s.blackout, icon("blackout"), "Blackout");
  const freeze = make_switch(session, "freeze", (s) => s.frozen, icon("freeze"), "Freeze");
  by_id("stage-buttons").append(freeze, blackout);
  let is_hidden_by_window = false,
    is_resting = false;
  const want = () => session.link.want_pictures(!document.hidden && !is_hidden_by_window && !is_resting);
  document.addEventListener("visibilitychange", want);
  want();

  let room_why = ""; // why there is no image of the room; empty: there is one

  session.link.addEventListener("picture", async ({ detail }) => {
    const seen = () => session.link.send({ type: "seen", picture: detail.number });
    room_why = detail.jpeg.size ? "" : detail.json.why || "There is no image of the room.";
    stage.say_why();
    if (room_why) return setTimeout(seen, k_again_ms);
    try {
      draw_picture(room, await createImageBitmap(detail.jpeg));
      room.dataset.picture = detail.number;
    } catch {
      // A broken image is skipped; the next one will come.
    }
    seen();
  });

  const why = (state) => {
    if (session.link.status !== "connected") return "No connection: this image is not live";
    if (state?.blackout) return "Blackout: the projectors give no light";
    if (state?.frozen) return "Frozen: what is shown stays as it is";
    return room_why;
  };
  const stage = {
    /** Text over the image that replaces the stage's own text; empty: none. */
    words: "",
    show(state) {
      blackout.show(state);
      freeze.show(state);
      set_text(by_id("last-edit"), in_words(state.last_edit, state));
      stage.say_why();
    },
    /** While glasses are on, nobody sees the room's image: it is not requested. */
    rest(rests) {
      is_resting = rests;
      want();
    },
    say_why() {
      set_text(by_id("view-why"), stage.words || why(session.state));
    },
    /** While the window shows its own image, the room's is neither requested nor shown. */
    give_to_window(is_given) {
      is_hidden_by_window = is_given;
      room.hidden = is_given;
      by_id("window-picture").hidden = !is_given;
      want();
    },
  };
  session.link.addEventListener("status", () => stage.say_why());
  return stage;
}
