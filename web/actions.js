// Everything that can be done, as of scene::actions(); a test compares the two. The rows are JSON. `role` is the least that
// may do it (the server decides and tells its own), `label` is what the page calls it.
export const actions = [
  {"name": "next_variant", "of_slot": true, "takes": "nothing", "role": "work", "label": "next variant"},
  {"name": "previous_variant", "of_slot": true, "takes": "nothing", "role": "work", "label": "previous variant"},
  {"name": "choose_variant", "of_slot": true, "takes": "text", "role": "work", "label": "variant"},
  {"name": "nudge", "of_slot": true, "takes": "millimetres", "role": "work", "label": "nudged"},
  {"name": "place", "of_slot": true, "takes": "pose", "role": "work", "label": "placed"},
  {"name": "release", "of_slot": true, "takes": "nothing", "role": "work", "label": "follows its marker again"},
  {"name": "pair", "of_slot": true, "takes": "maybe_text", "role": "operate", "label": "carried by"},
  {"name": "unpair", "of_slot": true, "takes": "nothing", "role": "operate", "label": "has its own marker again"},
  {"name": "units", "of_slot": true, "takes": "text", "role": "operate", "label": "unit"},
  {"name": "material", "of_slot": true, "takes": "maybe_text", "role": "work", "label": "material"},
  {"name": "save_look", "of_slot": false, "takes": "maybe_text", "role": "work", "label": "saved look"},
  {"name": "restore_look", "of_slot": false, "takes": "text", "role": "work", "label": "look"},
  {"name": "next_look", "of_slot": false, "takes": "nothing", "role": "work", "label": "next look"},
  {"name": "previous_look", "of_slot": false, "takes": "nothing", "role": "work", "label": "previous look"},
  {"name": "flip", "of_slot": false, "takes": "maybe_text", "role": "work", "label": "flipped to the other look"},
  {"name": "split", "of_slot": false, "takes": "on_off", "role": "work", "label": "split"},
  {"name": "split_at", "of_slot": false, "takes": "number", "role": "work", "label": "split moved"},
  {"name": "delete_look", "of_slot": false, "takes": "text", "role": "work", "label": "deleted look"},
  {"name": "undelete_look", "of_slot": false, "takes": "nothing", "role": "work", "label": "brought the look back"},
  {"name": "repair", "of_slot": false, "takes": "nothing", "role": "operate", "label": "repair"},
  {"name": "light", "of_slot": false, "takes": "maybe_text", "role": "work", "label": "light"},
  {"name": "blackout", "of_slot": false, "takes": "on_off", "role": "work", "label": "blackout"},
  {"name": "freeze", "of_slot": false, "takes": "on_off", "role": "work", "label": "freeze"},
  {"name": "grid", "of_slot": false, "takes": "on_off", "role": "work", "label": "grid"},
  {"name": "marker_states", "of_slot": false, "takes": "on_off", "role": "operate", "label": "marker states"},
  {"name": "screen", "of_slot": false, "takes": "maybe_text", "role": "operate", "label": "screen"},
  {"name": "viewer", "of_slot": false, "takes": "maybe_text", "role": "work", "label": "view parts for"}
];

const known = new Map(actions.map((action) => [action.name, action]));

/** The role that an action needs. */
export function role_of(name) {
  return known.get(name)?.role ?? "operate";
}

/** Takes over the server's own roles, from its table of actions. */
export function take_roles(table) {
  for (const { name, role } of table ?? []) if (role && known.has(name)) known.get(name).role = role;
}

/** What somebody did, in words for people. */
export function in_words(edit, state) {
  if (!edit?.action) return "";
  const slot = state.slots.find((s) => s.name === edit.slot);
  const who = edit.who || "Somebody";
  if (edit.action.endsWith("_variant") && slot) return `${who}: ${slot.name} is ${slot.variant}`;
  if (["restore_look", "next_look", "previous_look", "flip", "save_look"].includes(edit.action) && state.look)
    return `${who}: ${edit.action === "save_look" ? "saved look" : "look"} ${state.look}`;
  const is_on = { blackout: state.blackout, freeze: state.frozen, grid: state.grid, marker_states: state.marker_states,
                  split: state.split }[edit.action];
  const named = edit.action === "viewer" ? edit.value || "the scene's own viewer" : edit.value;
  const value = edit.action === "place" ? "" : is_on === undefined ? named : is_on ? "on" : "off";
  const unit = edit.action === "nudge" || edit.action === "split_at" ? " mm" : "";
  return `${who}: ${[edit.slot, known.get(edit.action)?.label ?? edit.action, value && value + unit].filter(Boolean).join(" ")}`;
}
