"""The remote as an app on a network: a Chromium that trusts limn.crt shows no warning and can install the page.

    app_test.py --limn build/release/limn --out FOLDER
"""

import argparse
import contextlib
import os
import shutil
import socket
import ssl
import subprocess
import sys
import urllib.request

from browser import Browser, Driver, wait_for
from web_test import Live, expect

SKIPPED = 77


def own_address():
    """An address at which other machines can reach this one; None if it has none."""
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as asked:
        try:
            asked.connect(("192.0.2.1", 9))  # sends nothing
        except OSError:
            return None
        found = asked.getsockname()[0]
        return None if found.startswith("127.") or found == "0.0.0.0" else found


def authority_of(url):
    """Downloads the authority's certificate without checking the server's."""
    with urllib.request.urlopen(url + "/limn.crt", context=ssl._create_unverified_context(), timeout=20) as answer:
        expect(answer.headers["Content-Type"] == "application/x-x509-ca-cert", "a certificate", answer.headers["Content-Type"])
        return answer.read()


def trust(certificate, home):
    """Installs a certificate, as a person does in the device's settings."""
    store, file = os.path.join(home, ".pki", "nssdb"), os.path.join(home, "limn.crt")
    os.makedirs(store)
    with open(file, "wb") as out:
        out.write(certificate)
    subprocess.run(["certutil", "-d", "sql:" + store, "-N", "--empty-password"], check=True)
    subprocess.run(["certutil", "-d", "sql:" + store, "-A", "-n", "Limn", "-t", "C,,", "-i", file], check=True)


def is_warned_of(url, home):
    with contextlib.closing(Driver(home)) as driver, contextlib.closing(Browser(driver, believes_all=False)) as browser:
        browser.open(url)
        return browser.script("return location.href").startswith("chrome-error:")


def check_app(url, home, out):
    with contextlib.closing(Driver(home)) as driver, contextlib.closing(Browser(driver, believes_all=False)) as browser:
        browser.resize(390, 844, True)
        browser.open(url + "/")
        wait_for("the page", lambda: browser.text("h1") == "Limn")
        browser.screenshot(os.path.join(out, "trusted.png"))
        expect(browser.script("return isSecureContext"), "a secure page", "another")
        worker = browser.script_async("return (await navigator.serviceWorker.ready).active.scriptURL;")
        expect(worker.endswith("/service-worker.js"), "Limn's service worker", worker)
        manifest = browser.cdp("Page.getAppManifest")
        expect(manifest["url"] and not manifest["errors"], "a manifest without errors", manifest)
        errors = browser.cdp("Page.getInstallabilityErrors")["installabilityErrors"]
        expect(not errors, "a page that can be installed", errors)


def main():
    parser = argparse.ArgumentParser()
    for name in ("limn", "out"):
        parser.add_argument(f"--{name}", required=True)
    options = parser.parse_args()
    address = own_address()
    if not address:
        print("skipped: this machine has only the loopback address")
        return SKIPPED
    shutil.rmtree(options.out, ignore_errors=True)
    home, stranger, config = (os.path.join(options.out, name) for name in ("home", "stranger", "config"))
    for folder in (home, stranger):
        os.makedirs(folder)
    with contextlib.closing(Live(options.limn, options.out, f"{address}:0", config)) as live:
        expect(live.url.startswith("https://"), "https", live.url)
        expect(is_warned_of(live.url, stranger), "a warning by a browser that does not trust the authority", "none")
        trust(authority_of(live.url), home)
        check_app(live.url, home, options.out)
    print("passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
