// The panel Room: tracking, devices, people, comments, messages of the session.
import { make_comments } from "/comments.js";
import { by_id, h, keep, set_text } from "/dom.js";
import { tracking_badge } from "/parts.js";

const k_glasses = {
  waiting: "glasses that no camera sees",
  looking_round: "glasses that find the room",
  registered: "glasses",
  lost: "glasses without tracking",
  asleep: "glasses asleep",
};
const words_of = ({ role, glasses }) => (glasses ? `${role}, ${k_glasses[glasses] ?? glasses}` : role);

const k_most_notes = 20; // only the newest are shown

function row(name) {
  const badge = tracking_badge(),
    words = h("span", { class: "soft small" });
  const node = h("li", {}, h("b", {}, name), words, badge);
  node.show = (sight, text) => {
    badge.show(sight);
    set_text(words, text);
  };
  return node;
}

// Shares the link to the review page with the device's share dialog, or copies it to the clipboard.
async function share(session) {
  const url = `${location.origin}/review`;
  try {
    if (navigator.share) return await navigator.share({ title: "Limn: looks", url });
    await navigator.clipboard.writeText(url);
    session.say("The link to the looks was copied. Opening it needs a PIN.");
  } catch (reason) {
    if (reason.name !== "AbortError") session.say(`The looks are at ${url}`);
  }
}

export function make_room(session) {
  const tracking = h("ul", { class: "rows" }),
    devices = h("ul", { class: "rows" }),
    people = h("ul", { class: "rows" });
  const no_devices = h("p", { class: "soft small" }, "No devices are monitored.");
  const pace = h("p", { class: "soft small" });
  const notes = h("ul", { class: "messages small" });
  const no_notes = h("p", { class: "soft small" }, "Nothing to report.");
  const comments = make_comments(session, () => ({ look: session.state.look, slot: "" }), "General comment");
  const repair_words = h("span", {}, "Repair: recalibrate moved devices");
  const repair = session.button("repair", { class: "wide" }, repair_words);
  const leave = h("button", { type: "button", class: "wide", onclick: () => session.link.leave() }, "Leave");
  const link = h("button", { type: "button", class: "wide", onclick: () => share(session) }, "Share the looks");
  by_id("people").append(
    h("h2", {}, "Room"),
    h("h3", {}, "Tracking"),
    tracking,
    h("h3", {}, "Devices"),
    devices,
    no_devices,
    pace,
    repair,
    h("h3", {}, "People"),
    people,
    h("h3", {}, "Comments"),
    comments,
    h("h3", {}, "Messages"),
    notes,
    no_notes,
    link,
    leave,
  );
  return {
    show(state) {
      const bodies = state.prototype
        ? [{ name: "prototype", sight: state.prototype, marker: "" }, ...state.slots]
        : state.slots;
      keep(
        tracking,
        bodies,
        (body) => body.name,
        (body) => row(body.name),
      );
      bodies.forEach((body, i) => tracking.children[i].show(body.sight, body.marker));
      keep(
        devices,
        state.devices,
        (device) => device.name,
        (device) => row(device.name),
      );
      state.devices.forEach((device, i) =>
        devices.children[i].show(device.works ? "works" : "broken", device.why || device.kind),
      );
      no_devices.hidden = state.devices.length > 0;
      pace.hidden = !state.pace;
      set_text(pace, state.pace ?? "");
      keep(
        people,
        state.guests.map((guest, i) => ({ ...guest, i })),
        (guest) => `${guest.name} ${guest.role} ${guest.glasses} ${guest.i}`,
        (guest) => h("li", {}, h("b", {}, guest.name || "Guest"), h("span", { class: "soft small" }, words_of(guest))),
      );
      repair.disabled = state.repair !== "";
      set_text(repair_words, state.repair ? `Repair: ${state.repair}` : "Repair: recalibrate moved devices");
      comments.show(state.comments);
      keep(
        notes,
        state.notes.slice(-k_most_notes).reverse(),
        (note) => `${note.at_s} ${note.text}`,
        (note) => h("li", {}, h("span", { class: "soft" }, `${note.at_s.toFixed(0)} s `), note.text),
      );
      no_notes.hidden = state.notes.length > 0;
    },
  };
}
