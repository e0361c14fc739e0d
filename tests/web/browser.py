"""A headless Chromium, driven through Debian's chromedriver (W3C WebDriver) with Python's standard library alone."""

import base64
import contextlib
import functools
import http.server
import json
import os
import shutil
import subprocess
import tempfile
import threading
import time
import urllib.error
import urllib.request

WAIT_S = 60.0  # longest wait for a condition; long because the machine may be busy; a test that passes does not wait for it
ENTER, ESCAPE, TAB = "\ue007", "\ue00c", "\ue004"  # WebDriver's codes
ELEMENT = "element-6066-11e4-a52e-4f735466cecf"


class Failed(Exception):
    """A failed check: says what was expected and what was found."""


def wait_for(what, condition, timeout_s=WAIT_S):
    """Returns condition() as soon as it is true. Fails with the description `what` if it does not become true in time."""
    until = time.monotonic() + timeout_s
    while True:
        found = condition()
        if found:
            return found
        if time.monotonic() > until:
            raise Failed(f"expected {what} within {timeout_s:.0f} s, found {found!r}")
        time.sleep(0.02)


class Driver:
    """A running chromedriver."""

    def __init__(self, home=None):
        """`home`: home folder of the browsers, instead of the user's own."""
        environment = os.environ | ({"HOME": home} if home else {})
        self.process = subprocess.Popen(["chromedriver", "--port=0"], env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                        text=True)
        for line in self.process.stdout:
            if "started successfully on port" in line:
                self.url = "http://127.0.0.1:" + line.rstrip(". \n").split()[-1]
                return
        raise Failed("expected chromedriver to start, found that it ended. Is chromium-driver installed?")

    def close(self):
        self.process.terminate()
        self.process.wait()


class Browser:
    """One Chromium with its own profile."""

    def __init__(self, driver, camera=None, arguments=(), believes_all=True):
        """`believes_all`: accept all certificates."""
        self.driver = driver
        self.profile = tempfile.mkdtemp(prefix="limn-web-")
        arguments = ["--headless=new", "--disable-gpu", "--enable-unsafe-swiftshader", "--hide-scrollbars", "--no-first-run",
                     "--disable-background-networking", "--disable-component-update", f"--user-data-dir={self.profile}",
                     "--disable-dev-shm-usage", *arguments]
        if os.geteuid() == 0:
            arguments.append("--no-sandbox")
        if camera:
            arguments += ["--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream",
                          f"--use-file-for-fake-video-capture={camera}"]
        wanted = {"browserName": "chrome", "acceptInsecureCerts": believes_all,
                  "goog:chromeOptions": {"args": arguments}, "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"}}
        answer = self._call("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
        self.session = "/session/" + answer["sessionId"]

    def close(self):
        try:
            self._call("DELETE", self.session)
        finally:
            shutil.rmtree(self.profile, ignore_errors=True)

    def _call(self, method, path, body=None):
        data = None if method != "POST" else json.dumps(body or {}).encode()
        request = urllib.request.Request(self.driver.url + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as refusal:
            raise Failed(json.load(refusal)["value"]["message"].splitlines()[0]) from None

    def settle(self):
        """Waits until changes are on the screen and animations have ended."""
        self.script_async("await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));"
                          "await Promise.all(document.getAnimations().map((animation) => animation.finished));")

    def open(self, url):
        self._call("POST", self.session + "/url", {"url": url})

    def script(self, code, *arguments):
        """Runs the function body `code` and returns its result."""
        return self._call("POST", self.session + "/execute/sync", {"script": code, "args": list(arguments)})

    def script_async(self, code, *arguments):
        """Runs `code` as the body of an async function and returns its result."""
        wrapped = f"""
            const done = arguments[arguments.length - 1], given = [...arguments].slice(0, -1);
            (async (...args) => {{ {code} }})(...given).then((value) => done({{ value }}), (error) => done({{ error: String(error) }}));"""
        answer = self._call("POST", self.session + "/execute/async", {"script": wrapped, "args": list(arguments)})
        if "error" in answer:
            raise Failed(answer["error"])
        return answer.get("value")

    def cdp(self, command, **parameters):
        return self._call("POST", self.session + "/goog/cdp/execute", {"cmd": command, "params": parameters})

    def find(self, selector):
        """The elements that a CSS selector finds."""
        found = self._call("POST", self.session + "/elements", {"using": "css selector", "value": selector})
        return [element[ELEMENT] for element in found]

    def click(self, selector):
        """Clicks the first visible element of a selector, as a person would."""
        found = wait_for(f"something to click at {selector}", lambda: [e for e in self.find(selector) if self.is_shown(e)])
        self._call("POST", f"{self.session}/element/{found[0]}/click")

    def is_shown(self, element):
        try:
            return self._call("GET", f"{self.session}/element/{element}/displayed")
        except Failed:
            return False  # the element was removed meanwhile

    def type(self, selector, text):
        element = wait_for(f"something to type into at {selector}", lambda: self.find(selector))[0]
        self._call("POST", f"{self.session}/element/{element}/value", {"text": text})

    def press(self, key, times=1):
        down_and_up = [{"type": "keyDown", "value": key}, {"type": "keyUp", "value": key}]
        keys = {"type": "key", "id": "keys", "actions": down_and_up * times}
        self._call("POST", self.session + "/actions", {"actions": [keys]})

    def text(self, selector):
        return self.script("return document.querySelector(arguments[0])?.textContent ?? ''", selector)

    def log(self, kind):
        """Entries logged since the last call: kind "browser" (console) or "performance" (DevTools events)."""
        return self._call("POST", self.session + "/se/log", {"type": kind})

    def resize(self, width, height, is_phone=False):
        self.cdp("Emulation.setDeviceMetricsOverride", width=width, height=height, mobile=is_phone,
                 deviceScaleFactor=2 if is_phone else 1)

    def screenshot(self, path):
        with open(path, "wb") as file:
            file.write(base64.b64decode(self._call("GET", self.session + "/screenshot")))


class Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def answer_on_page(folder, page, script, *arguments):
    """What a script answers in a browser with WebGL, on a page of a folder of files."""
    handler = functools.partial(Silent, directory=folder)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    options = ("--enable-unsafe-swiftshader", "--use-gl=angle", "--use-angle=swiftshader")
    with contextlib.closing(Driver()) as driver, contextlib.closing(Browser(driver, arguments=options)) as browser:
        browser.open(f"http://127.0.0.1:{server.server_address[1]}/{page}")
        return browser.script_async(script, *arguments)
