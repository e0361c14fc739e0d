"""Takes a picture of the glasses' own camera in a browser, from a texture that a fake of WebXR gives to the page's own code.

    glasses_camera_test.py PAGE_FOLDER
"""

import sys

from browser import answer_on_page

WIDTH, HEIGHT, FOCAL_PX = 1280, 720, 900

# The picture is red above and blue below, with a green corner at the left above. A texture's last row is the picture's first.
TAKE = """
const [width, height, focal] = args;
const gl = document.createElement("canvas").getContext("webgl2");
const pixels = new Uint8Array(4 * width * height);
for (let y = 0; y < height; ++y)
  for (let x = 0; x < width; ++x) {
    const is_above = y >= height / 2, is_corner = is_above && x < width / 4, at = 4 * (y * width + x);
    pixels.set([is_above && !is_corner ? 255 : 0, is_corner ? 255 : 0, is_above ? 0 : 255, 255], at);
  }
const texture = gl.createTexture();
gl.bindTexture(gl.TEXTURE_2D, texture);
gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
window.XRWebGLBinding = class { getCameraImage() { return texture; } };
const view = {
  camera: { width, height },
  transform: { orientation: { w: 0.8, x: 0, y: 0.6, z: 0 }, position: { x: 1, y: 2, z: 3 } },
  projectionMatrix: [2 * focal / width, 0, 0, 0, 0, 2 * focal / height, 0, 0, 0.1, -0.2, -1, -1, 0, 0, -0.2, 0],
};
const { GlassesCamera } = await import("/glasses_camera.js");
const camera = new GlassesCamera({}, gl), pose = { views: [view] };
const [message, bytes] = await new Promise((take) => camera.take(1000, pose, (...taken) => take(taken)));
const is_too_early = camera.take(1010, pose, () => {}) === false;
const binary = new Uint8Array(await new Blob([bytes]).arrayBuffer());
const image = await createImageBitmap(new Blob([binary.slice(4)], { type: "image/jpeg" }));
const canvas = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height });
const context = canvas.getContext("2d");
context.drawImage(image, 0, 0);
const at = (x, y) => [...context.getImageData(x * image.width, y * image.height, 1, 1).data].slice(0, 3);
return {
  message, is_too_early, number: new DataView(binary.buffer).getUint32(0, true), size: [image.width, image.height],
  corner: at(0.1, 0.2), above: at(0.6, 0.2), below: at(0.5, 0.8), gl_error: gl.getError(),
  is_granted: GlassesCamera.is_granted({ enabledFeatures: ["camera-access"] }),
  is_granted_without: GlassesCamera.is_granted({ enabledFeatures: [] }),
};
"""


def problems_of(taken):
    """What is not as the message glasses_view and its picture must be, in words."""
    message, scale = taken["message"], 960 / WIDTH
    width, height = 960, 540
    # The projection matrix's third column moves the centre: x by 0.1, y by -0.2 of half the picture.
    lens = [FOCAL_PX * scale, FOCAL_PX * scale, width / 2 * 0.9 - 0.5, height / 2 * 0.8 - 0.5]
    wanted = {
        "type": "glasses_view", "picture": 1, "rotation_wxyz": [0.8, 0, 0.6, 0], "translation_m": [1, 2, 3], "width": width,
        "height": height,
    }
    out = [f"{key}: expected {value}, found {message.get(key)}" for key, value in wanted.items() if message.get(key) != value]
    if max(abs(a - b) for a, b in zip(message["lens_px"], lens)) > 0.01:
        out.append(f"lens_px: expected {lens}, found {message['lens_px']}")
    facts = {"number": 1, "size": [width, height], "gl_error": 0, "is_too_early": True, "is_granted": True, "is_granted_without": False}
    out += [f"{key}: expected {value}, found {taken[key]}" for key, value in facts.items() if taken[key] != value]
    for place, colour in {"corner": (0, 255, 0), "above": (255, 0, 0), "below": (0, 0, 255)}.items():
        if max(abs(a - b) for a, b in zip(taken[place], colour)) > 12:
            out.append(f"{place}: expected the colour {colour}, found {taken[place]}")
    return out


def main():
    problems = problems_of(answer_on_page(sys.argv[1], "glasses_camera.js", TAKE, WIDTH, HEIGHT, FOCAL_PX))
    print("\n".join(problems) or "passed")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
