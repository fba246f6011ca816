"""From a slider of the studio to the new picture, part by part: `python -m tests.benchmarks.studio PROFILE PICTURE`.

The whole page is served here and driven in headless Chromium, whose WebGL2 is SwiftShader's, on the processor. Times
are the medians of single moves, with pauses between them, in ms; "picture" is the whole way, as the visitor sees it.
"""

import argparse
import os
import re
import socket
import statistics
import time
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import panel as pn
from playwright.sync_api import expect, sync_playwright

from lutforge.studio import look_page
from lutforge.studio.opening import Folders
from lutforge.studio.page import CSS, Page
from tests.studio.test_page import CHROMIUM, Visit

SOCKET = """
const Plain = window.WebSocket;
window.traffic = [];
const now = () => performance.timeOrigin + performance.now();
window.WebSocket = class extends Plain {
  constructor(...all) {
    super(...all);
    this.addEventListener("message", ({ data }) => window.traffic.push(["in", now(), data.byteLength ?? data.length]));
  }
  send(data) { window.traffic.push(["out", now(), 0]); super.send(data); }
};"""
MOVES = """async (root, values) => {
  const now = () => performance.timeOrigin + performance.now(), moves = [];
  const find = (node, found = []) => {
    for (const each of node.querySelectorAll("*")) {
      if (each.matches("input[type=range]")) found.push(each);
      if (each.shadowRoot) find(each.shadowRoot, found);
    }
    return found;
  };
  const input = find(document).find(each => each.max === "3");
  const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
  for (const value of values) {
    const before = root.dataset.drawn, start = now();
    window.traffic.length = 0;
    set.call(input, value);
    for (const name of ["input", "change"]) input.dispatchEvent(new Event(name, { bubbles: true }));
    while (root.dataset.drawn === before && now() - start < 5000) await new Promise(next => setTimeout(next, 1));
    const end = now();
    moves.push({ start, end, draw: Number(root.dataset.ms), upload: Number(root.dataset.upload || 0),
      traffic: window.traffic.filter(each => each[1] <= end) });
    await new Promise(next => setTimeout(next, 500));
  }
  return moves;
}"""


def timed(spans: list[tuple[float, float]], function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, with the times at which it began and ended, in ms, added to a list."""

    @wraps(function)
    def run(*arguments: Any, **options: Any) -> Any:
        began = time.time()
        try:
            return function(*arguments, **options)
        finally:
            spans.append((1e3 * began, 1e3 * time.time()))

    return run


def processor_seconds() -> dict[str, float]:
    """Processor time of this process, and of the browser's that draw the page and grade the picture."""
    found = {"Python": time.process_time()}
    for each in Path("/proc").glob("[0-9]*"):
        try:
            command, fields = (each / "cmdline").read_text(), (each / "stat").read_text().rsplit(")", 1)[1].split()
        except OSError:  # it has ended
            continue
        for kind, name in (("--type=renderer", "page"), ("--type=gpu-process", "WebGL")):
            if "chrom" in command and kind in command:
                ticks = int(fields[11]) + int(fields[12])
                found[name] = found.get(name, 0.0) + ticks / os.sysconf("SC_CLK_TCK")
    return found


def parts(move: dict[str, Any], spans: list[tuple[float, float]]) -> dict[str, float]:
    """What took how long on the way of one move, ms; and what was sent, kB."""
    sent = next(at for way, at, _ in move["traffic"] if way == "out")
    began, done = next(span for span in spans if span[0] > move["start"] - 5)
    received = [(at, size) for way, at, size in move["traffic"] if way == "in" and at > began]
    table = max(received, key=lambda one: one[1])[0]
    return {
        "picture": move["end"] - move["start"],
        "slider to socket": sent - move["start"],
        "socket to Python": began - sent,
        "Python": done - began,
        "Python to page": table - done,
        "upload": move["upload"],
        "draw": move["draw"],
        "page to picture": move["end"] - table,
        "kB": sum(size for _, size in received) / 1e3,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("profile", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--setting", default="", help="STYLE/WB to take the picture as, where it does not tell")
    parser.add_argument("--sizes", default="1280x720,1920x1080,3840x2160")
    given = parser.parse_args()
    spans: list[tuple[float, float]] = []
    look_page.LookPage._grade = timed(spans, look_page.LookPage._grade)  # type: ignore[method-assign]
    pn.extension(raw_css=[CSS], notifications=False, theme="dark")
    folders = Folders((given.profile.resolve().parent,))
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    page = {"/": lambda: Page(folders, (given.profile,)).layout}
    server = pn.serve(page, port=port, address="127.0.0.1", show=False, threaded=True, verbose=False)
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=options)
        for size in given.sizes.split(","):
            width, height = map(int, size.split("x"))
            context = browser.new_context(viewport={"width": width, "height": height})
            context.add_init_script(SOCKET)
            visit = Visit(context, f"http://127.0.0.1:{port}/")
            visit.reads("profile of")
            visit.step("Look")
            visit.write("or its path", str(given.picture.resolve()))
            visit.press("Show")
            root = visit.page.locator(".look")
            expect(root).to_have_attribute("data-opened", re.compile("×"), timeout=60_000)
            if given.setting:
                style, balance = given.setting.split("/")
                visit.choose("Taken as: style", style)
                visit.choose("Taken as: white balance", balance)
            visit.choose("Wanted: white balance", "daylight")
            visit.page.wait_for_timeout(2000)
            values = [round(-1 + 0.1 * move, 1) for move in range(24) if move != 10]
            before = processor_seconds()
            moves = root.evaluate(MOVES, values)
            spent = {
                name: 1e3 * (seconds - before.get(name, 0.0)) / len(values)
                for name, seconds in processor_seconds().items()
            }
            found = [parts(move, spans) for move in moves[2:]]
            shown = ", ".join(f"{name} {statistics.median(each[name] for each in found):.1f}" for name in found[0])
            worst = sorted(each["picture"] for each in found)[int(0.9 * len(found))]
            print(f"{size}: {shown}; 90 % within {worst:.0f}; load {os.getloadavg()[0]:.1f}")
            told = ", ".join(f"{name} {milliseconds:.1f}" for name, milliseconds in spent.items())
            print(f"    processor time a move, the pause after it included: {told}", flush=True)
            assert visit.errors == [], visit.errors
            context.close()
        browser.close()
    server.stop()


if __name__ == "__main__":
    main()
