// Makes elements and keeps them: a new state changes only what differs, so focus and scroll positions stay.

/** Makes an element. Properties that begin with "on" become listeners, booleans become properties, all others attributes. */
export function h(tag, properties, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties ?? {})) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (typeof value === "boolean") node[name] = value;
    else if (value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== undefined));
  return node;
}

/** Makes an icon of icons.svg, hidden from screen readers. */
export function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const use = document.createElementNS("http://www.w3.org/2000/svg", "use");
  use.setAttribute("href", `/icons.svg#${name}`);
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  svg.append(use);
  return svg;
}

/** Gives `parent` one child for each item, in order. make(item) is called once for each key, then child.update(item). */
export function keep(parent, items, key, make) {
  const old = new Map([...parent.children].map((child) => [child.key, child]));
  let at = parent.firstElementChild;
  for (const item of items) {
    const name = key(item);
    let child = old.get(name);
    old.delete(name);
    if (!child) {
      child = make(item);
      child.key = name;
    }
    if (child === at) at = at.nextElementSibling;
    else parent.insertBefore(child, at);
    child.update?.(item);
  }
  for (const child of old.values()) child.remove();
}

/** Sets a node's text only if it differs, so that a screen reader reads only changes. */
export function set_text(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export const by_id = (id) => document.getElementById(id);
