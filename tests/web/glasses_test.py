"""Glasses on the page: Chromium with an emulated headset (npm package iwer), against a served session of the studio.

    glasses_test.py --room web_glasses_room --out FOLDER [--only marker|camera|camera-soon]

A person wears them who has a marker on the glasses (`marker`), and another one whose glasses have none, but give the page
photographs of their camera (`camera`; `camera-soon`: for some seconds only). The script moves the clocks of the room and of the headset, a step for each frame, so that nothing depends on how fast
the machine draws. Seconds in results are seconds of the person's motion.
iwer is installed into FOLDER with npm; without npm or its registry the checks that need it are skipped (code 77).
Screenshots are written to FOLDER.
"""

import argparse
import base64
import contextlib
import json
import math
import os
import shutil
import subprocess
import sys
import time

from browser import Browser, Driver, Failed, wait_for

SKIPPED = 77
HERE = os.path.dirname(os.path.abspath(__file__))
IWER = "iwer@2.5.0"
STEP_S = 1 / 30
MOST_REGISTER_S, MOST_OFF_MM, MOST_OFF_DEG = 10.0, 1.0, 0.1
MOST_OFF_PX, LEAST_IOU, MOST_BYTES = 2.0, 0.98, 2000
READY = "The glasses know where they are in the room."
SIZE = (1280, 640)  # of both eyes
IPD_M = 0.063
# The glasses' camera is at the left eye and has its field of view (glasses_in_page.js). It takes a photograph in every
# second frame; frames are twice as long, because nothing is measured between two photographs.
SOON_S, MOST_OFF_SOON_MM, MOST_OFF_SOON_DEG = 3.0, 3.0, 0.3
CAMERA_PX, CAMERA_FOCAL_PX, CAMERA_STEP_S = 960, 480 / math.tan(math.radians(55 / 2)), 1 / 15


def expect(is_so, what, found=""):
    if not is_so:
        raise Failed(f"expected {what}, found {found}")


def installed_iwer(folder):
    """The text of iwer's bundle; None, with the reason printed, if npm cannot fetch it."""
    bundle = os.path.join(folder, "npm", "node_modules", "iwer", "build", "iwer.min.js")
    if not os.path.exists(bundle):
        if not shutil.which("npm"):
            print("skipped: no npm is installed, which fetches the emulated headset (iwer)")
            return None
        prefix = os.path.join(folder, "npm")
        os.makedirs(prefix, exist_ok=True)
        command = ["npm", "install", "--prefix", prefix, "--no-audit", "--no-fund", "--fetch-retries", "0", IWER]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=90)
            why = "" if done.returncode == 0 else done.stderr.strip().splitlines()[-1:]
        except subprocess.TimeoutExpired:
            why = "no answer within 90 s"
        if why or not os.path.exists(bundle):
            print(f"skipped: npm could not fetch the emulated headset ({IWER}): {why}")
            return None
    with open(bundle) as file:
        return file.read()


class Room:
    """web_glasses_room, and its answers."""

    def __init__(self, program, folder, *how):
        os.makedirs(folder, exist_ok=True)
        self.log = open(os.path.join(folder, "room.log"), "w")
        self.process = subprocess.Popen([program, folder, *how], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.log,
                                        text=True)
        self.invitation = self._answer()
        self.url = self.invitation["url"].rstrip("/")
        with open(os.path.join(folder, "path.json")) as file:
            self.path = json.load(file)

    def _answer(self):
        for line in self.process.stdout:
            if line.startswith("{"):
                return json.loads(line)
        raise Failed("expected an answer of the room, found that it ended; see room.log")

    def ask(self, *words):
        self.process.stdin.write(" ".join(str(word) for word in words) + "\n")
        self.process.stdin.flush()
        return self._answer()

    def close(self):
        self.process.stdin.close()
        self.process.wait(30)
        self.log.close()


class Mask:
    """A mask as one large number, first pixel first."""

    def __init__(self, bits, width):
        self.text, self.bits, self.count, self.width = bits, int(bits, 16), 4 * len(bits), width

    def moved(self, dx, dy):
        by = dx + dy * self.width
        return (self.bits >> by) if by >= 0 else (self.bits << -by) & ((1 << self.count) - 1)

    def area(self):
        return count(self.bits)

    def most(self, share):
        """The column and the row that this share of the mask's pixels lies before."""
        rows = [self.bits >> at & ((1 << self.width) - 1) for at in range(self.count - self.width, -1, -self.width)]
        by_row = [count(row) for row in rows]
        by_column = [sum(column) for column in zip(*([bit == "1" for bit in f"{row:0{self.width}b}"] for row in rows))]
        place = lambda counts: next(at for at in range(len(counts)) if sum(counts[:at + 1]) >= share * self.area())
        return place(by_column), place(by_row)


def count(bits):
    return bin(bits).count("1")


def corner(right, bottom, width, height):
    """The upper left corner of an image, as the bits of a mask."""
    row, out = ((1 << right) - 1) << (width - right), 0
    for _ in range(bottom):
        out = out << width | row
    return out << width * (height - bottom)


def iou(one, two, dx=0, dy=0):
    moved = one.moved(dx, dy)
    either = count(moved | two.bits)
    return count(moved & two.bits) / either if either else 1.0


def offset_px(drawn, true):
    """By how many pixels a mask must be moved for the best overlap; sub-pixel by a parabola."""
    best = max(((iou(drawn, true, dx, dy), dx, dy) for dx in range(-4, 5) for dy in range(-4, 5)))
    _, x, y = best
    peak = lambda low, high: (low - high) / 2 / min(-1e-9, low - 2 * best[0] + high)
    return math.hypot(x + peak(iou(drawn, true, x - 1, y), iou(drawn, true, x + 1, y)),
                      y + peak(iou(drawn, true, x, y - 1), iou(drawn, true, x, y + 1)))


def pose_product(one, two):
    """a_from_c of a_from_b and b_from_c, each [w, x, y, z, tx, ty, tz]."""
    (w, x, y, z), (a, b, c, d), p = one[:4], two[:4], two[4:]
    rotation = [w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a]
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    return rotation + [sum(m * v for m, v in zip(row, p)) + t for row, t in zip(rows, one[4:])]


def difference(one, two):
    """The distance (mm) and the angle (degrees) between two poses."""
    alike = abs(sum(a * b for a, b in zip(one[:4], two[:4]))) / math.hypot(*one[:4]) / math.hypot(*two[:4])
    return 1e3 * math.dist(one[4:], two[4:]), math.degrees(2 * math.acos(min(1, alike)))


class Checks:
    step_s = STEP_S

    def __init__(self, room, driver, iwer, out):
        self.room, self.driver, self.iwer, self.out, self.measured = room, driver, iwer, out, {}
        self.now_s = self.at_s = 0.0  # the session's clock; where in the walk the person is

    @contextlib.contextmanager
    def page(self, *scripts):
        """The page of a paired guest, with scripts that run before its own."""
        with contextlib.closing(Browser(self.driver, arguments=("--enable-unsafe-swiftshader", "--use-gl=angle",
                                                                "--use-angle=swiftshader"))) as browser:
            browser.resize(*SIZE)
            for script in scripts:
                browser.cdp("Page.addScriptToEvaluateOnNewDocument", source=script)
            browser.open(f"{self.room.url}/#pin={self.room.invitation['pins'][1]}")
            browser.type("[name=name]", "Ann\ue007")
            wait_for("a session", lambda: browser.script("return document.body.dataset.status") == "connected")
            browser.click("#tabs [data-tab=window]")
            yield browser

    def without_webxr_the_window_is_offered_and_why(self):
        for script, words in (("", "no immersive-ar"), ("delete Navigator.prototype.xr;", "no WebXR"),
                              ("Object.defineProperty(window, 'isSecureContext', { value: false });", "only with https")):
            with self.page(script) as browser:
                found = wait_for("words about glasses", lambda: browser.text("#glasses-why"))
                expect(words in found and "window" in found, f"words about {words}", found)
                expect(not browser.is_shown(browser.find("#glasses")[0]), "no button", "one")
                expect(browser.find("#window button.main"), "the window's button", "none")

    def step(self, browser, at_s):
        """The person is at a moment of the walk, a frame's time later. Returns the state that the page was told last."""
        self.now_s, self.at_s = self.now_s + self.step_s, at_s
        self.room.ask("step", f"{self.now_s:.6f}", f"{at_s:.6f}")
        return browser.script_async("return limn_glasses.step(...args);", self.now_s, at_s)

    def walk(self, browser, until_s):
        """The person walks on until that moment."""
        while self.at_s < until_s - 1e-6:
            yield self.step(browser, min(until_s, self.at_s + self.step_s))

    def stand(self, browser, what, condition):
        """The person stands still until something is so."""
        def condition_after_a_step():
            self.step(browser, self.at_s)
            return condition()
        return wait_for(what, condition_after_a_step)

    def stop_at(self, station):
        """The moment of the walk in the middle of a station."""
        return self.room.path["look_round_s"] + station * self.room.path["station_s"] + 2

    def look_round(self, browser):
        """The person looks round until the glasses are registered. Returns for how long."""
        self.at_s = 0.0
        for state in self.walk(browser, self.room.path["look_round_s"]):
            if state == "registered":
                return self.at_s
        raise Failed(f"expected a place in the room, found {state}: {browser.text('#glasses-why')}")

    def the_glasses_find_the_room(self, browser):
        browser.script("limn_glasses.set_path(arguments[0])", self.room.path)
        browser.click("#glasses")
        self.stand(browser, "words on what to do", lambda: browser.text("#glasses-why"))
        for _ in range(30):
            state = self.step(browser, 0)
        expect(state == "looking_round", "that the glasses are not placed before the head moves", state)
        browser.screenshot(os.path.join(self.out, "looking-round.png"))
        self.place_is_found(browser)

    def place_is_found(self, browser):
        """The person looks round; the glasses are registered in time, and then the eyes are where they are."""
        registered_s = self.measured["registered_s"] = round(self.look_round(browser), 2)
        for _ in self.walk(browser, MOST_REGISTER_S):
            pass
        offs = []
        for eye in self.capture(browser):
            expect(eye.get("world_from_feed"), "a place in the room", eye)
            offs.append(difference(pose_product(eye["world_from_feed"], eye["feed_from_view"]), self.true_eye(eye)))
        self.measured["eye_off_mm"], self.measured["eye_off_deg"] = (round(max(off), 3) for off in zip(*offs))
        expect(registered_s <= MOST_REGISTER_S, f"a place within {MOST_REGISTER_S} s", registered_s)
        expect(all(mm <= MOST_OFF_MM and degrees <= MOST_OFF_DEG for mm, degrees in offs),
               f"the eyes within {MOST_OFF_MM} mm and {MOST_OFF_DEG} degrees", offs)

    def capture(self, browser):
        return browser.script_async("return limn_glasses.capture();")

    def true_masks(self, eye, world_from_view):
        p = eye["projection"]
        return self.room.ask("mask", eye["width"], eye["height"], p[0], p[5], p[8], p[9], *world_from_view)

    def true_eye(self, eye):
        side = {"left": -1, "right": 1, "none": 0}[eye["eye"]]
        return self.room.ask("eye", f"{self.at_s:.6f}", side * IPD_M / 2)["world_from_view"]

    def draw_parts(self, browser, mode):
        browser.script(f"document.querySelector('[data-glasses-parts={mode}]').click()")

    def parts_are_drawn_where_they_are(self, browser):
        captured = []
        for station in range(self.room.path["stations"]):
            for _ in self.walk(browser, self.stop_at(station)):
                pass
            self.stand(browser, "all parts on the page", lambda: browser.text("#glasses-why") == READY)
            for mode in ("full", "rest"):
                self.draw_parts(browser, mode)
                captured += [(station, mode, eye, self.true_eye(eye)) for eye in self.capture(browser)]
                browser.screenshot(os.path.join(self.out, f"station-{station}-{mode}.png"))
        offs, rests, rests_in_truth = [], [], []
        for station, mode, eye, true_eye in captured:
            expect(eye.get("world_from_feed"), "a place at each station", eye.get("world_from_feed"))
            drawn = Mask(eye["bits"], eye["width"])
            there = Mask(self.true_masks(eye, true_eye)[mode], eye["width"])
            self.save(f"station-{station}-{mode}-{eye['eye']}", eye, there)
            expect(there.area() > 200, "something to see", there.area())
            if mode == "full":
                offs.append(offset_px(drawn, there))
                continue
            rests_in_truth.append(iou(drawn, there))
            same_eye = self.true_masks(eye, pose_product(eye["world_from_feed"], eye["feed_from_view"]))
            rests.append(iou(drawn, Mask(same_eye["rest"], eye["width"])))
        rounded = lambda values, digits: [round(value, digits) for value in values]
        rms = math.sqrt(sum(off * off for off in offs) / len(offs))
        self.measured |= {"off_px": rounded(offs, 2), "off_px_rms": round(rms, 3), "rest_iou": rounded(rests, 4),
                          "rest_iou_of_the_true_eye": rounded(rests_in_truth, 4)}
        expect(rms <= MOST_OFF_PX, f"at most {MOST_OFF_PX} px", self.measured)
        expect(min(rests) >= LEAST_IOU, f"an overlap of {LEAST_IOU}", self.measured)

    def tracked_hands_hide_parts(self, browser):
        self.draw_parts(browser, "full")
        before = [Mask(eye["bits"], eye["width"]) for eye in self.capture(browser)]
        browser.script("limn_glasses.raise_a_hand()")
        self.step(browser, self.at_s)
        after = [Mask(eye["bits"], eye["width"]) for eye in self.capture(browser)]
        browser.screenshot(os.path.join(self.out, "tracked-hand.png"))
        hidden = self.measured["hidden_by_hand"] = [round(1 - b.area() / a.area(), 3) for a, b in zip(before, after)]
        expect(max(hidden) > 0.05 and all(share < 0.95 for share in hidden), "a part that a hand hides in part", hidden)
        browser.script("limn_glasses.device.primaryInputMode = 'controller'")
        self.step(browser, self.at_s)

    def depth_hides_parts(self, browser, name="depth"):
        """A hand that the depth sensor sees covers the upper left corner of each image, and there a share of the parts."""
        self.draw_parts(browser, "full")
        for at in (0, 1):
            eye = self.capture(browser)[at]
            width, height = eye["width"], eye["height"]
            true = Mask(self.true_masks(eye, pose_product(eye["world_from_feed"], eye["feed_from_view"]))["full"], width)
            right, bottom = (4 * round(place / 4) for place in true.most(0.7))
            browser.script("limn_glasses.hold_a_hand_up(...arguments)", right / width, bottom / height)
            drawn = Mask(self.capture(browser)[at]["bits"], width)
            hand, middle = corner(right, bottom, width, height), corner(right - 8, bottom - 8, width, height)
            hidden, beside = count(true.bits & hand), true.bits & ~hand
            expect(hidden > 200 and count(beside) > 200, "parts behind the hand and beside it", (hidden, count(beside)))
            expect(not drawn.bits & middle, "nothing drawn over the hand", count(drawn.bits & middle))
            overlap = count(drawn.bits & beside) / count(drawn.bits | beside)
            expect(overlap > 0.9, "the parts beside the hand", overlap)
        browser.screenshot(os.path.join(self.out, f"{name}.png"))

    def put_on_again(self, browser, depth_usage, *features):
        """Other glasses, whose browser grants this."""
        browser.script("document.querySelector('#glasses').click()")
        wait_for("the button again", lambda: "Put the glasses on" in browser.text("#glasses"))
        browser.script("limn_glasses.grant(...arguments)", depth_usage, ["local-floor", *features])
        browser.click("#glasses")
        self.stand(browser, "words on what to do", lambda: browser.text("#glasses-why"))
        self.look_round(browser)
        self.stand(browser, "all parts on the page",
                   lambda: browser.text("#glasses-why").startswith(READY) and "fetched" not in browser.text("#glasses-why"))

    def depth_by_texture_hides_parts(self, browser):
        self.put_on_again(browser, "gpu-optimized")
        self.depth_hides_parts(browser, "depth-buffer")
        browser.script("limn_glasses.give_depth_as_phones_do()")
        self.depth_hides_parts(browser, "depth-of-a-phone")

    def what_hides_no_parts_is_said(self, browser):
        self.put_on_again(browser, "none", "hand-tracking")
        expect("Only hands hide parts" in browser.text("#glasses-why"), "words about hands", browser.text("#glasses-why"))
        self.put_on_again(browser, "none")
        expect("Parts are drawn over hands" in browser.text("#glasses-why"), "words about hands", browser.text("#glasses-why"))
        browser.screenshot(os.path.join(self.out, "no-depth.png"))

    def save(self, name, eye, there):
        """Both masks as one image: red drawn, green true, so that yellow is right."""
        width, height = eye["width"], eye["height"]
        drawn, wanted = (bin(int("1" + bits, 16))[3:] for bits in (eye["bits"], there.text))
        pixels = bytes(v for a, b in zip(drawn, wanted) for v in (255 * (a == "1"), 255 * (b == "1"), 0))
        with open(os.path.join(self.out, name + ".ppm"), "wb") as file:
            file.write(b"P6 %d %d 255\n" % (width, height) + pixels)

    def traffic_is_small(self, browser):
        """At 30 frames a second, with as many messages to the page as docs/remote.md allows at most."""
        one = browser.script("return limn_glasses.traffic()")
        self.at_s = 5.0
        for _ in self.walk(browser, 7):
            pass
        two = browser.script("return limn_glasses.traffic()")
        frames, largest = two["frames"] - one["frames"], two["largest"]
        by_frame = sum(two[key] - one[key] for key in ("sent", "others")) / frames
        each = by_frame + STEP_S * (10 * largest["glasses"] + 20 * largest["glasses_parts"])
        self.measured["bytes_a_frame"] = round(each)
        expect(frames >= 60 and two["sent"] > one["sent"] and min(largest.values()) > 0, "messages", two)
        expect(each <= MOST_BYTES, f"at most {MOST_BYTES} bytes a frame", each)

    def guests(self, browser):
        return browser.script_async("return (await (await fetch('/api/state')).json()).guests;")

    def sleep_is_seen_by_all(self, browser):
        browser.script("limn_glasses.hide(true)")
        self.step(browser, self.at_s)
        wait_for("glasses asleep among the guests", lambda: self.guests(browser)[0].get("glasses") == "asleep")
        wait_for("words on the page", lambda: browser.text("#glasses-why").startswith("The glasses sleep"))
        browser.screenshot(os.path.join(self.out, "asleep.png"))
        browser.script("limn_glasses.hide(false)")
        self.measured["registered_again_s"] = round(self.look_round(browser), 2)
        wait_for("the place again", lambda: self.guests(browser)[0].get("glasses") == "registered")

    def taking_them_off_changes_no_projector(self, browser):
        before = self.room.ask("projected")["projected"]
        browser.script("document.querySelector('#glasses').click()")
        wait_for("a guest without glasses", lambda: "glasses" not in self.guests(browser)[0])
        expect(self.room.ask("projected")["projected"] == before == self.room.invitation["projected"],
               "the same projector images", "others")
        wait_for("the button again", lambda: "Put the glasses on" in browser.text("#glasses"))
        severe = [entry["message"] for entry in browser.log("browser") if entry["level"] == "SEVERE"]
        expect(not severe, "no errors on the console", severe)

    def all(self):
        self._run(self.without_webxr_the_window_is_offered_and_why)
        if not self.iwer:
            return SKIPPED
        return self.in_glasses(self.the_glasses_find_the_room, self.parts_are_drawn_where_they_are, self.tracked_hands_hide_parts,
                               self.depth_hides_parts, self.traffic_is_small, self.sleep_is_seen_by_all,
                               self.depth_by_texture_hides_parts, self.what_hides_no_parts_is_said,
                               self.taking_them_off_changes_no_projector)

    def in_glasses(self, *checks):
        with open(os.path.join(HERE, "glasses_in_page.js")) as file:
            driver = file.read()
        with self.page(self.iwer, driver) as browser:
            for check in checks:
                try:
                    self._run(check, browser)
                except Failed:
                    browser.screenshot(os.path.join(self.out, "failed.png"))
                    print("words:", browser.text("#glasses-why"), "places:",
                          browser.script("return JSON.stringify(limn_glasses.places.slice(-3))"),
                          [entry["message"] for entry in browser.log("browser")][-5:])
                    raise
        return 0

    def _run(self, check, *given):
        at = time.monotonic()
        check(*given)
        print(f"passed {check.__name__} ({time.monotonic() - at:.1f} s)", flush=True)


class CameraChecks(Checks):
    """Glasses without a marker, which the room finds by the photographs of their own camera."""

    step_s = CAMERA_STEP_S

    def __init__(self, *given):
        super().__init__(*given)
        self.is_open, self.steps, self.sent = True, 0, 0

    def step(self, browser, at_s):
        self.steps += 1
        if not self.is_open or self.steps % 2:
            return super().step(browser, at_s)
        self.now_s, self.at_s = self.now_s + self.step_s, at_s
        taken = self.room.ask("photograph", f"{at_s:.6f}", -IPD_M / 2, CAMERA_PX, CAMERA_FOCAL_PX)
        with open(taken["photograph"], "rb") as file:
            png = base64.b64encode(file.read()).decode()
        self.room.ask("step", f"{self.now_s:.6f}", f"{at_s:.6f}")
        found = browser.script_async("return limn_glasses.step_with_photograph(...args);", self.now_s, at_s, png)
        self.sent += found["is_sent"]
        looked_at = self.room.ask("located", self.sent)
        expect(looked_at["looked_at"] == self.sent, f"that the room looks at {self.sent} photographs", looked_at)
        self.measured |= {"photographs": self.sent, "located": looked_at["located"]}
        return found["state"]

    def the_camera_finds_the_room(self, browser):
        self.put_on(browser)
        self.place_is_found(browser)

    def put_on(self, browser):
        browser.script("limn_glasses.set_path(arguments[0])", self.room.path)
        browser.script("limn_glasses.grant('cpu-optimized', ['local-floor', 'hand-tracking', 'camera-access'])")
        browser.click("#glasses")
        self.is_open = False  # the camera is covered
        self.stand(browser, "words on what to do", lambda: "Look at the prototype" in browser.text("#glasses-why"))
        expect(self.step(browser, 0) == "waiting", "that the glasses are not placed without a photograph", self.measured)
        place = browser.script("return limn_glasses.places.at(-1)")
        expect((place["marker"], place["markers"]) == ("camera", ["camera"]), "glasses by their camera", place)
        browser.screenshot(os.path.join(self.out, "waiting.png"))
        self.is_open = True

    def parts_are_soon_where_they_are(self, browser):
        self.put_on(browser)
        self.measured["registered_s"] = round(self.look_round(browser), 2)
        for _ in self.walk(browser, SOON_S):
            pass
        self.stand(browser, "all parts on the page", lambda: browser.text("#glasses-why") == READY)
        self.draw_parts(browser, "full")
        offs, offs_px = [], []
        for eye in self.capture(browser):
            true_eye = self.true_eye(eye)
            offs.append(difference(pose_product(eye["world_from_feed"], eye["feed_from_view"]), true_eye))
            there = Mask(self.true_masks(eye, true_eye)["full"], eye["width"])
            self.save(f"soon-{eye['eye']}", eye, there)
            expect(there.area() > 200, "something to see", there.area())
            offs_px.append(round(offset_px(Mask(eye["bits"], eye["width"]), there), 2))
        self.measured |= {"eye_off_mm_deg": [[round(value, 3) for value in off] for off in offs], "off_px": offs_px}
        expect(all(mm <= MOST_OFF_SOON_MM and degrees <= MOST_OFF_SOON_DEG for mm, degrees in offs),
               f"the eyes within {MOST_OFF_SOON_MM} mm and {MOST_OFF_SOON_DEG} degrees", offs)
        expect(max(offs_px) <= MOST_OFF_PX, f"at most {MOST_OFF_PX} px", offs_px)

    def soon(self):
        return self.in_glasses(self.parts_are_soon_where_they_are) if self.iwer else SKIPPED

    def all(self):
        if not self.iwer:
            return SKIPPED
        return self.in_glasses(self.the_camera_finds_the_room, self.parts_are_drawn_where_they_are,
                               self.taking_them_off_changes_no_projector)


def main():
    parser = argparse.ArgumentParser()
    for name in ("room", "out"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--only", choices=("marker", "camera", "camera-soon"))
    options = parser.parse_args()
    os.makedirs(options.out, exist_ok=True)
    iwer = installed_iwer(options.out)
    code = 0
    for kind, way in (("marker", []), ("camera", ["camera"])):
        is_soon = kind == "camera" and options.only == "camera-soon"
        if options.only not in (None, kind) and not is_soon:
            continue
        out = os.path.join(options.out, *way)
        with contextlib.closing(Room(options.room, out, *way)) as room, contextlib.closing(Driver()) as driver:
            checks = (CameraChecks if way else Checks)(room, driver, iwer, out)
            try:
                code = max(code, checks.soon() if is_soon else checks.all())
            except Failed as failure:
                print(f"FAILED: {failure}\nmeasured: {checks.measured}\nsee {out}")
                return 1
            print(kind, json.dumps(checks.measured))
    return code


if __name__ == "__main__":
    sys.exit(main())
