// Describes edits in words, and knows which role an action needs. The table of actions comes from the session (message
// `hello`), so this file lists only actions whose label differs from their name; a test compares the two.

const k_words = {
  "choose_variant": "variant",
  "nudge": "nudged",
  "place": "placed",
  "release": "follows its marker again",
  "pair": "carried by",
  "unpair": "has its own marker again",
  "units": "unit",
  "save_look": "saved look",
  "restore_look": "look",
  "flip": "flipped to the other look",
  "split_at": "split moved",
  "delete_look": "deleted look",
  "undelete_look": "brought the look back",
  "draw_line": "drawn",
  "erase_line": "removed",
  "smooth_line": "smoothed",
  "move_line": "moved",
  "rename_line": "is now",
  "viewer": "view parts for"
};

const known = new Map(); // the session's table of actions, by name

/** Stores the session's table of actions. */
export function take_actions(table) {
  for (const action of table ?? []) known.set(action.name, action);
}

/** The role that an action needs. */
export function role_of(name) {
  return known.get(name)?.role ?? "operate";
}

const label_of = (name) => k_words[name] ?? name.replaceAll("_", " ");

// The value of an edit in words.
function value_of(edit, state) {
  const takes = known.get(edit.action)?.takes;
  if (edit.action === "line") return (state.lines_on ?? []).includes(edit.slot) ? "on" : "off";
  if (takes === "on_off") return state[edit.action === "freeze" ? "frozen" : edit.action] ? "on" : "off";
  if (takes === "pose" || edit.action === "draw_line" || edit.action === "move_line") return "";
  if (edit.action === "viewer") return edit.value || "the scene's own viewer";
  return edit.value && (takes === "millimetres" || takes === "number") ? `${edit.value} mm` : edit.value;
}

/** Describes an edit in words. */
export function in_words(edit, state) {
  if (!edit?.action) return "";
  const slot = state.slots.find((s) => s.name === edit.slot);
  const who = edit.who || "Somebody";
  if (edit.action.endsWith("_variant") && slot) return `${who}: ${slot.name} is ${slot.variant}`;
  if (["restore_look", "next_look", "previous_look", "flip", "save_look"].includes(edit.action) && state.look)
    return `${who}: ${edit.action === "save_look" ? "saved look" : "look"} ${state.look}`;
  return `${who}: ${[edit.slot, label_of(edit.action), value_of(edit, state)].filter(Boolean).join(" ")}`;
}
