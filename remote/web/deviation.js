// The comparison of the prototype with its CAD: scan, result, alignment, report.
import { h, keep, set_text } from "/dom.js";

const signed = (mm) => `${mm > 0 ? "+" : ""}${mm.toFixed(2)} mm`;

/** Buttons and the result; hidden in a scene without a prototype. */
export function make_deviation(session) {
  const scan_words = h("span", {}, "Scan the prototype");
  const scan = session.button("deviation", { value: "scan", class: "wide" }, scan_words);
  const shown = session.button("deviation", { value: "toggle", class: "grow" }, "Show the colours");
  const hold = session.button(
    "deviation",
    { value: () => (session.state.deviation?.is_held ? "hold off" : "hold on"), class: "grow" },
    "Keep the alignment",
  );
  const whole = session.button("deviation", { value: "fit off", class: "wide" }, "Align the whole prototype again");
  const report = session.button("deviation", { value: "report", class: "wide" }, "Write the report");
  const tolerance = h("input", { type: "number", min: "0.05", max: "2", step: "0.05", "aria-label": "Tolerance, mm" });
  tolerance.addEventListener("change", () => tolerance.value && session.act("deviation", "", `tolerance ${tolerance.value}`));
  const words = h("p", { class: "soft small" }),
    file = h("p", { class: "soft small" }),
    extremes = h("ul", { class: "rows" });
  const node = h(
    "div",
    { class: "stack", "data-needs": "work", hidden: true },
    h("h3", {}, "Deviation from the CAD"),
    scan,
    h("div", { class: "line" }, shown, hold),
    h("div", { class: "line named" }, h("span", { class: "soft" }, "Tolerance, mm"), tolerance),
    words,
    extremes,
    whole,
    report,
    file,
  );
  node.show = ({ prototype, deviation }) => {
    node.hidden = !prototype || !deviation;
    if (node.hidden) return;
    const has_result = deviation.text !== "";
    scan.disabled = deviation.progress !== "";
    set_text(scan_words, deviation.progress ? `Scan: ${deviation.progress}` : "Scan the prototype");
    for (const button of [shown, hold, report]) button.disabled = !has_result;
    shown.setAttribute("aria-pressed", String(deviation.is_shown));
    hold.setAttribute("aria-pressed", String(deviation.is_held));
    whole.hidden = !deviation.is_fitted;
    if (document.activeElement !== tolerance) tolerance.value = deviation.tolerance_mm;
    set_text(words, deviation.text);
    set_text(file, deviation.report ? `Report: ${deviation.report}` : "");
    keep(
      extremes,
      deviation.extremes,
      ({ mm, at_mm }) => `${mm} ${at_mm}`,
      ({ mm, at_mm }) =>
        h("li", {}, h("b", {}, signed(mm)), h("span", { class: "soft small" }, `at ${at_mm.map((v) => v.toFixed(0)).join(", ")} mm`)),
    );
  };
  return node;
}
