// Shared by both pages: the connection, pairing, messages about the connection, edits and their results.
import { role_of, take_actions } from "/actions.js";
import { by_id, h, icon, set_text } from "/dom.js";
import { Link } from "/link.js";
import { prepare_pairing, tell_pairing } from "/pairing.js";

const k_roles = ["look", "work", "operate"]; // each has the permissions of those before it

/**
 * `on_state(state)` is called for each state, `on_hello(message)` for each new connection; `purpose` and `name_hint` are texts of
 * the pairing form.
 */
export function begin_session({ on_state, on_hello, purpose, name_hint }) {
  const link = new Link();
  const session = { link, state: null };

  /** Shows a message to the person; with `is_bad` a screen reader reads it at once. */
  session.say = (text, is_bad = false) => {
    const note = h(
      "div",
      { class: is_bad ? "note bad" : "note", role: is_bad ? "alert" : "status" },
      h("span", {}, text),
    );
    note.append(
      h(
        "button",
        { class: "quiet", "aria-label": "Close this message", onclick: () => note.remove() },
        icon("close"),
      ),
    );
    by_id("notes").replaceChildren(note);
    setTimeout(() => note.remove(), is_bad ? 9000 : 5000);
  };

  /** Triggers an action; shows the reason if it is refused. Returns whether it was done. */
  session.act = async (action, slot, value, button) => {
    button?.setAttribute("aria-busy", "true");
    try {
      await link.edit(action, slot, value);
      return true;
    } catch (refusal) {
      session.say(refusal.message, true);
      return false;
    } finally {
      button?.removeAttribute("aria-busy");
    }
  };

  /**
   * A button that triggers an action; `value` may be a function. It is hidden from roles that may not use it; with data-stays it is
   * shown, but disabled.
   */
  session.button = (action, { slot, value, ...properties }, ...children) => {
    const button = h(
      "button",
      { type: "button", "data-action": action, "data-needs": role_of(action), ...properties },
      ...children,
    );
    button.addEventListener("click", () =>
      session.act(action, slot, typeof value === "function" ? value() : value, button),
    );
    fit_role(button, link.role);
    return button;
  };

  link.addEventListener("hello", ({ detail }) => {
    take_actions(detail.actions);
    document.body.dataset.role = link.role;
    for (const node of document.querySelectorAll("[data-action]")) {
      node.dataset.needs = role_of(node.dataset.action);
      fit_role(node, link.role);
    }
    on_hello?.(detail);
  });
  link.addEventListener("state", ({ detail }) => {
    session.state = detail;
    on_state(detail);
    document.body.dataset.number = detail.number;
  });
  link.addEventListener("status", ({ detail }) => show_status(link, detail));
  prepare_pairing(link, purpose, name_hint);
  return session;
}

function fit_role(node, role) {
  if (node.dataset.stays === undefined) return;
  node.disabled = k_roles.indexOf(role) < k_roles.indexOf(node.dataset.needs);
  node.title = node.disabled ? `Needs the PIN for ${node.dataset.needs}` : "";
}

const k_words = { connecting: "Connecting …", waiting: "No connection. Trying again …" };

function show_status(link, { status, why }) {
  const is_paired = status !== "unpaired";
  document.body.dataset.status = status;
  by_id("pairing").hidden = is_paired;
  by_id("session").hidden = !is_paired;
  set_text(by_id("link"), k_words[status] ?? `${link.name || "Guest"}, ${link.role}`);
  if (!is_paired && why) tell_pairing(why);
}
