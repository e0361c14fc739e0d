"""Cuts small bodies with the page's own code, and compares what is seen with their closed form.

    cut_test.py PAGE_FOLDER
"""

import sys

from browser import answer_on_page

# A block with a cavity on its left, beside a sheet that closes nothing, all of two materials. It is seen along -z without perspective,
# x and y from -1 to 1, by a program that shows a cap magenta and all else green.
FACTS = """
const { bind_cut, Caps, closed_indices, k_cut, k_cut_inputs } = await import("/cut.js");
const { make_pass } = await import("/mesh_gl.js");
const side = 160;
const gl = Object.assign(document.createElement("canvas"), { width: side, height: side })
  .getContext("webgl2", { preserveDrawingBuffer: true, antialias: false, stencil: true });

const mesh = { positions: [], indices: [] };
const block = ([x, y, z], [a, b, c], is_reversed) => {
  for (let axis = 0; axis < 3; ++axis)
    for (const sign of [-1, 1]) {
      const first = mesh.positions.length / 3;
      for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
        const p = [0, 0, 0];
        p[axis] = sign;
        p[(axis + 1) % 3] = u;
        p[(axis + 2) % 3] = sign * v;
        mesh.positions.push(x + a * p[0], y + b * p[1], z + c * p[2]);
      }
      for (const [i, k] of [[1, 2], [2, 3]]) mesh.indices.push(first, first + (is_reversed ? k : i), first + (is_reversed ? i : k));
    }
};
block([0, 0, 0], [0.6, 0.6, 0.5], false);
block([-0.3, 0, 0], [0.2, 0.3, 0.25], true);
const closed_count = mesh.indices.length, first = mesh.positions.length / 3;
mesh.positions.push(0.7, -0.5, -0.4, 0.9, -0.5, -0.4, 0.9, 0.5, -0.4);
mesh.indices.push(first, first + 1, first + 2);
const positions = Float32Array.from(mesh.positions), part = [[0, 60], [60, mesh.indices.length]].map(([from, to]) => {
  const indices = Uint32Array.from(mesh.indices.slice(from, to)), array = gl.createVertexArray();
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, positions, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
  return { positions, indices, array, count: indices.length };
});

const pass = make_pass(gl, `#version 300 es
uniform mat4 u_clip_from_mesh;
in vec3 a_position;
${k_cut_inputs}
void main() { pass_cut(a_position); gl_Position = u_clip_from_mesh * vec4(a_position, 1); }`, `#version 300 es
precision highp float;
out vec4 o_colour;
${k_cut}
void main() {
  vec3 cap = cap_colour();
  if (is_cut_away()) discard;
  o_colour = vec4(u_is_cap ? cap : vec3(0, 1, 0), 1);
}`);
const clip_from_mesh = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]);
const caps = new Caps(gl, make_pass);
const draw = (cut) => {
  gl.viewport(0, 0, side, side);
  gl.enable(gl.DEPTH_TEST);
  gl.clearColor(0, 0, 0, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
  const use = () => {
    gl.useProgram(pass.program);
    return pass.at;
  };
  use();
  gl.uniformMatrix4fv(pass.at("u_clip_from_mesh"), false, clip_from_mesh);
  bind_cut(gl, pass.at, cut);
  for (const { array, count } of part) {
    gl.bindVertexArray(array);
    gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 0);
  }
  if (cut) caps.draw(part, clip_from_mesh, cut, use);
  const pixels = new Uint8Array(4 * side * side);
  gl.readPixels(0, 0, side, side, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return (column, row) => [...pixels.slice(4 * (row * side + column), 4 * (row * side + column) + 3)];
};
const seen = ([r, g, b]) => (r > 200 && g < 50 && b > 200 ? "cap" : g > 200 ? "part" : r + g + b === 0 ? "nothing" : "mixed");

const within = (p, [x, y, z], [a, b, c], margin) =>
  Math.abs(p[0] - x) < a + margin && Math.abs(p[1] - y) < b + margin && Math.abs(p[2] - z) < c + margin;
// 1: surely inside the body, -1: surely outside, 0: near its surface.
const inside = (p) => {
  const margin = 0.03, block_at = [[0, 0, 0], [0.6, 0.6, 0.5]], cavity_at = [[-0.3, 0, 0], [0.2, 0.3, 0.25]];
  if (within(p, ...block_at, -margin) && !within(p, ...cavity_at, margin)) return 1;
  return !within(p, ...block_at, margin) || within(p, ...cavity_at, -margin) ? -1 : 0;
};

const whole = { line: [0, 1], hatch: [0, 0, 0], colour: [1, 0, 1] };
let seed = 7;
const random = () => ((seed = (seed * 1103515245 + 12345) % 2147483648) / 1073741824) - 1;
const found = { closed: closed_indices(part).map((indices) => indices.length), wanted_closed: [60, closed_count - 60], mistakes: [], judged: 0 };
for (let plane = 0; plane < 60; ++plane) {
  const n = plane % 10 === 0 ? [0, 0, 1] : [random(), random(), 1.2 + random()], length = Math.hypot(...n);
  const normal = n.map((value) => value / length), offset_m = 0.45 * random(), at = draw({ ...whole, normal, offset_m });
  for (let row = 2; row < side; row += 5)
    for (let column = 2; column < side; column += 5) {
      const [x, y] = [(2 * column + 1) / side - 1, (2 * row + 1) / side - 1], z = (offset_m - normal[0] * x - normal[1] * y) / normal[2];
      const is_inside = Math.abs(z) < 1 ? inside([x, y, z]) : 0, what = seen(at(column, row));
      if (is_inside === 0) continue;
      ++found.judged;
      if ((what === "cap") !== (is_inside === 1)) found.mistakes.push(`plane ${plane}: ${what} at ${[x, y, z].map((v) => v.toFixed(3))}`);
    }
}
const pixel = (at, x, y) => seen(at(Math.round(((x + 1) * side) / 2), Math.round(((y + 1) * side) / 2)));
const front = draw({ ...whole, normal: [0, 0, 1], offset_m: 0 });
found.front = { block: pixel(front, 0.3, 0), cavity: pixel(front, -0.3, 0), sheet: pixel(front, 0.85, 0), beside: pixel(front, 0, 0.8) };
const behind = draw({ ...whole, normal: [0, 0, 1], offset_m: -0.45 });
found.behind = { block: pixel(behind, 0.3, 0), sheet: pixel(behind, 0.85, 0) };
const uncut = draw(null);
found.uncut = { block: pixel(uncut, 0.3, 0), cavity: pixel(uncut, -0.3, 0), sheet: pixel(uncut, 0.85, 0) };
// Lines across x, four times in 1: dark on the first fifth of each.
const hatched = draw({ normal: [0, 0, 1], offset_m: 0, line: [0.2, 0.5], hatch: [4, 0, 0], colour: [1, 0, 1] });
let dark = 0, bright = 0;
for (let column = 80; column < 112; ++column) {
  const phase = (4 * ((2 * column + 1) / side - 1)) % 1, [red] = hatched(column, 80);
  if (phase > 0.05 && phase < 0.16 && Math.abs(red - 127.5) < 2) ++dark;
  if (phase > 0.25 && phase < 0.95 && red === 255) ++bright;
}
Object.assign(found, { dark, bright, gl_error: gl.getError() });
caps.forget(part);
return found;
"""


def problems_of(found):
    """What is not as it must be, in words."""
    wanted = {
        "closed": found["wanted_closed"],
        "mistakes": [],
        "front": {"block": "cap", "cavity": "part", "sheet": "part", "beside": "nothing"},
        "behind": {"block": "cap", "sheet": "nothing"},
        "uncut": {"block": "part", "cavity": "part", "sheet": "part"},
        "gl_error": 0,
    }
    out = [f"{name}: expected {value}, found {found[name]}" for name, value in wanted.items() if found[name] != value]
    out += [f"{name}: expected at least {least}, found {found[name]}"
            for name, least in {"judged": 10000, "dark": 2, "bright": 10}.items() if found[name] < least]
    return out


def main():
    problems = problems_of(answer_on_page(sys.argv[1], "glb.js", FACTS))
    print("\n".join(problems) or "passed")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
