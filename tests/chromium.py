"""A headless Chromium that tests steer by its own protocol."""

import base64
import contextlib
import io
import json
import shutil
import subprocess
import time
import urllib.request
from functools import partial

import numpy as np
from PIL import Image

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
NONE_HERE = "there is no Chromium here"


class Chromium:
    """A browser without a window; ``folder`` is an empty one for its profile."""

    def __init__(self, folder, size=(900, 520)):
        self._folder = folder
        self._process = subprocess.Popen(
            [
                CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--use-gl=angle",
                "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run",
                "--disable-background-networking", "--disable-component-update", "--disable-sync",
                "--hide-scrollbars", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
                f"--window-size={size[0]},{size[1]}", f"--user-data-dir={folder}",
                "--remote-debugging-port=0", "about:blank",
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        note = folder / "DevToolsActivePort"
        until(lambda: note.exists() and note.read_text().count("\n"), "the browser starts")
        self._port = int(note.read_text().split()[0])

    def open(self, url):
        """A new tab that shows a page."""
        request = urllib.request.Request(
            f"http://127.0.0.1:{self._port}/json/new?{url}", method="PUT"
        )
        with urllib.request.urlopen(request, timeout=20) as answer:
            return Tab(json.load(answer)["webSocketDebuggerUrl"])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(10)
        self._process.kill()


class Tab:
    """A page that a browser shows."""

    def __init__(self, address):
        from websockets.sync.client import connect

        self._socket = connect(address, max_size=None, open_timeout=20)
        self._calls = 0

    def call(self, method, **parameters):
        """The protocol's answer to a method."""
        self._calls += 1
        message = {"id": self._calls, "method": method, "params": parameters}
        self._socket.send(json.dumps(message))
        while True:
            answer = json.loads(self._socket.recv(timeout=60))
            if answer.get("id") == self._calls:
                assert "error" not in answer, answer
                return answer["result"]

    def value(self, script):
        """What a JavaScript expression is there."""
        found = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def text(self):
        """All that is written on the page."""
        return self.value("document.body.innerText")

    def place(self, selector, label=None):
        """Left, top, width and height of the first element [px], whose text is the label."""
        return self.value(
            f"""(() => {{
              const all = [...document.querySelectorAll({selector!r})];
              const one = all.find((e) => {json.dumps(label)} === null
                || e.innerText.trim() === {json.dumps(label)});
              if (!one) return null;
              one.scrollIntoView({{block: "center"}});
              const r = one.getBoundingClientRect();
              return [r.left, r.top, r.width, r.height];
            }})()"""
        )

    def click(self, selector, label=None, across=0.5):
        """Click an element, ``across`` of its width from its left."""
        place = partial(self.place, selector, label)

        def steady():
            first = place()
            time.sleep(0.2)  # [s]; what is still being laid out moves
            return first and first == place()

        until(steady, f"{selector} {label} is there")
        left, top, width, height = place()
        at = {"x": left + across * width, "y": top + 0.5 * height, "button": "left"}
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, clickCount=1, **at)

    def press(self, key):
        """Press and release a key."""
        code = ord(key.upper())
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code)

    def picture(self):
        """What the page looks like; RGB in 0..1."""
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), float) / 255.0

    def close(self):
        """Close the tab."""
        with contextlib.suppress(Exception):
            self.call("Page.close")
        self._socket.close()


def until(holds, what, seconds=90.0):
    """Wait until something holds; its value."""
    end = time.monotonic() + seconds
    while not (found := holds()):
        assert time.monotonic() < end, f"not within {seconds:g} s: {what}"
        time.sleep(0.05)
    return found
