// The form that pairs a browser with a session, by PIN and by a name that others see beside the edits.
import { by_id, h, set_text } from "/dom.js";
import { Link } from "/link.js";

/** Shows a message in the form. */
export function tell_pairing(text) {
  set_text(by_id("pairing-why"), text.charAt(0).toUpperCase() + text.slice(1));
}

function wait_before_pairing(why, wait_s, form) {
  const until = Date.now() + wait_s * 1000;
  form.querySelector("button").disabled = true;
  const timer = setInterval(tick, 1000);
  function tick() {
    const left_s = Math.ceil((until - Date.now()) / 1000);
    if (left_s > 0) return tell_pairing(`${why} Try again in ${left_s} s.`);
    clearInterval(timer);
    form.querySelector("button").disabled = false;
    tell_pairing("You can try again.");
  }
  tick();
}

function make_form(purpose, name_hint) {
  const name = { name: "name", maxlength: "40", autocomplete: "nickname", enterkeyhint: "next", placeholder: name_hint };
  const pin = {
    name: "pin",
    class: "pin",
    inputmode: "numeric",
    pattern: "[0-9]{6}",
    maxlength: "6",
    autocomplete: "one-time-code",
    enterkeyhint: "go",
    "aria-describedby": "pairing-why",
    placeholder: "······",
  };
  return h(
    "form",
    { autocomplete: "off" },
    h("img", { src: "/icon.svg", alt: "", width: "72", height: "72" }),
    h("h1", {}, "Limn"),
    h("p", { class: "soft" }, purpose),
    h("label", {}, "Your name", h("input", name)),
    h("label", {}, "PIN", h("input", pin)),
    h("p", { id: "pairing-why", role: "alert" }),
    h("button", { class: "main" }, "Pair"),
    location.protocol === "https:"
      ? h("p", { class: "soft" }, "To avoid certificate warnings, ", h("a", { href: "/limn.crt" }, "install this certificate"), " once.")
      : undefined,
  );
}

/** Fills #pairing with the form. Pairs with its PIN, or with the PIN in the address if a QR code was scanned. */
export function prepare_pairing(link, purpose, name_hint) {
  const form = make_form(purpose, name_hint);
  by_id("pairing").append(form);
  const pin = form.elements.pin,
    name = form.elements.name;
  name.value = localStorage.getItem("limn.name") ?? "";
  let is_asking = false;

  const pair = async () => {
    if (is_asking || form.querySelector("button").disabled) return;
    if (!/^\d{6}$/.test(pin.value)) {
      tell_pairing("The PIN has six digits.");
      return pin.focus();
    }
    is_asking = true;
    tell_pairing("Pairing …");
    localStorage.setItem("limn.name", name.value.trim());
    const { why, is_pin, wait_s } = await link.pair(pin.value, name.value.trim() || "Guest");
    is_asking = false;
    tell_pairing(why ?? "");
    if (!why || is_pin) pin.value = "";
    if (is_pin) pin.focus();
    if (wait_s) wait_before_pairing(why, wait_s, form);
  };

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    pair();
  });
  pin.addEventListener("input", () => {
    pin.value = pin.value.replace(/\D/g, "").slice(0, 6);
    if (pin.value.length === 6 && name.value.trim()) pair();
  });

  const linked = /^#pin=(\d{6})$/.exec(location.hash);
  if (linked) {
    history.replaceState(null, "", location.pathname);
    pin.value = linked[1];
    if (name.value) return pair();
    return name.focus();
  }
  if (Link.was_paired) link.connect();
  else (name.value ? pin : name).focus();
}
