// Comments on looks and parts: a list of them and a form to write one.
import { h, icon, keep } from "/dom.js";

function made(comment) {
  const head = h("p", { class: "soft small" });
  const pinned = [comment.look && `look ${comment.look}`, comment.slot].filter(Boolean).join(", ");
  const at = new Date(comment.at);
  head.append(
    h("b", {}, comment.who || "Somebody"),
    ` ${isNaN(at) ? "" : at.toLocaleString([], { dateStyle: "short", timeStyle: "short" })}`,
    pinned ? ` · ${pinned}` : "",
  );
  return h("li", {}, head, h("p", {}, comment.text));
}

/** Makes a list of comments and a form; node.show(comments) shows them, `target()` gives {look, slot} of a new comment. */
export function make_comments(session, target, label) {
  const list = h("ul", { class: "comments" });
  const none = h("p", { class: "soft small" }, "No comments yet.");
  const text = h("input", { "aria-label": label, placeholder: label, maxlength: "2000", enterkeyhint: "send" });
  const form = h(
    "form",
    { class: "line", "data-needs": "work" },
    text,
    h("button", { "aria-label": "Send the comment" }, icon("say")),
  );
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const said = text.value.trim();
    if (!said) return text.focus();
    const { look, slot } = target();
    try {
      await session.link.comment(look, slot, said);
      text.value = "";
    } catch (refusal) {
      session.say(refusal.message, true);
    }
  });
  const node = h("div", { class: "stack" }, list, none, form);
  node.show = (comments) => {
    none.hidden = comments.length > 0;
    keep(list, comments, (c) => `${c.at} ${c.who} ${c.look} ${c.slot} ${c.text}`, made);
  };
  return node;
}
