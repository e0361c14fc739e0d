// The live composite, what holds it back, the last edit, and the two switches that must always be at hand.
import { in_words } from "/actions.js";
import { by_id, icon, set_text } from "/dom.js";
import { draw_picture } from "/pictures.js";

const k_again_ms = 500; // until the room is asked for again when it has no picture

/** A switch that does an on_off action and shows whether it is on. */
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
  let is_hidden_by_window = false;
  const want = () => session.link.want_pictures(!document.hidden && !is_hidden_by_window);
  document.addEventListener("visibilitychange", want);
  want();

  let room_why = ""; // there is no picture of the room

  session.link.addEventListener("picture", async ({ detail }) => {
    const seen = () => session.link.send({ type: "seen", picture: detail.number });
    room_why = detail.jpeg.size ? "" : detail.json.why || "There is no picture of the room.";
    stage.say_why();
    if (room_why) return setTimeout(seen, k_again_ms);
    try {
      draw_picture(room, await createImageBitmap(detail.jpeg));
      room.dataset.picture = detail.number;
    } catch {
      // A picture that is broken is passed over: the next one comes.
    }
    seen();
  });

  const why = (state) => {
    if (session.link.status !== "connected") return "No connection: this picture stands still";
    if (state?.blackout) return "Blackout: the projectors give no light";
    if (state?.frozen) return "Frozen: what is shown stays as it is";
    return room_why;
  };
  const stage = {
    /** Words over the picture that come before the stage's own; empty: none. */
    words: "",
    show(state) {
      blackout.show(state);
      freeze.show(state);
      set_text(by_id("last-edit"), in_words(state.last_edit, state));
      stage.say_why();
    },
    say_why() {
      set_text(by_id("view-why"), stage.words || why(session.state));
    },
    /** While the window has its own picture the room's is neither asked for nor shown. */
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
