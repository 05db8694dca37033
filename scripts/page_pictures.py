"""Pictures of the page for the documents, each as a hand would come to it, in a real Chromium.

Usage: python scripts/page_pictures.py [NAME ...] [--out docs/images], each NAME one of those at the end of this file.
They are written as WebP, which is what the pages show.

The page must be built (`make viewer`), and the machine be quiet: the timing of the loop is in the pictures.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import trimesh

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "python"))

from browser import (  # noqa: E402
    CHROMIUM,
    FLAGS,
    Program,
    drag,
    opened,
    press,
    settled_depth,
    settled_force,
    state,
    until,
)
from playwright.sync_api import Browser, Page, sync_playwright  # noqa: E402
from web_site import served  # noqa: E402

import palpate  # noqa: E402
from shrink_pictures import shrunk  # noqa: E402

# So long the page has stood before its picture, s: the plots show ten seconds.
STANDS = 2.5


@contextlib.contextmanager
def page_of(
    chromium: Browser, *arguments: str, command: str = "demo", size: tuple[int, int] = (1280, 720), more: bool = True
) -> Iterator[Page]:
    """Open the page of a program on the user's own cache, with all controls or with few; the hint is dismissed."""
    program = Program(None, *arguments, command=command)
    try:
        with opened(chromium, program, size, sharpness=1.0, more=more) as page:
            page.emulate_media(color_scheme="dark")
            page.locator("#hint-close").click()
            yield page
    finally:
        program.stop()


def choose(page: Page, test_id: str, name: str) -> None:
    """Choose from a list, and wait until what takes long is done."""
    page.get_by_test_id(test_id).select_option(name)
    time.sleep(0.5)
    page.get_by_test_id("status").wait_for(state="hidden", timeout=60_000)


def take(page: Page, path: Path, contacts: int) -> None:
    """Take a picture of what touches; a page so slow that the program has let its tools go shows nothing."""
    page.screenshot(path=path)
    found = state(page)["contacts"]
    if found != contacts:
        raise SystemExit(f"{path.name}: {found} tools touch in place of {contacts}: the machine is too busy")


def viewer(chromium: Browser, out: Path) -> None:
    """Press a finger on the liver, as someone does who sees the page first."""
    with page_of(chromium, "liver", size=(1280, 800), more=False) as page:
        x, y = page.evaluate("window.palpate.pickPoint()")
        press(page, 3, place=(x, y + 30))
        time.sleep(STANDS)
        take(page, out / "viewer.png", 1)


def two_fingers(chromium: Browser, out: Path) -> None:
    """Pin one finger, and slide the other one beside it."""
    with page_of(chromium, "liver", size=(1400, 850)) as page:
        press(page, 2, place=(500, 300))
        page.keyboard.press("n")
        page.mouse.up()
        press(page, place=(700, 330), contacts=2)
        drag(page, (700, 330), (740, 360))
        settled_force(page)
        time.sleep(STANDS)
        take(page, out / "two-fingers.png", 2)


def motion(chromium: Browser, out: Path) -> None:
    """Strike a beam, and show half a second of its own time."""
    with page_of(chromium, "beam", "--impulse") as page:
        until(page, lambda s: s["motion"]["struck_at"] is not None)
        # Half a second, ten times slower, and what a busy machine needs.
        time.sleep(8.0)
        take(page, out / "motion.png", 0)


def tools(chromium: Browser, out: Path) -> None:
    """Lay a stylus on the kidney, and turn it by hand."""
    with page_of(chromium, "kidney", size=(1280, 800)) as page:
        choose(page, "shape-select", "capsule")
        x, y = page.evaluate("window.palpate.pickPoint()")
        press(page, 4, place=(x, y + 40))
        page.keyboard.down("Alt")
        drag(page, (x, y + 40), (x + 50, y + 30))
        page.keyboard.up("Alt")
        settled_force(page)
        time.sleep(STANDS)
        take(page, out / "tools.png", 1)


def cut(chromium: Browser, out: Path) -> None:
    """Cut the liver open under a finger, and show the stress inside."""
    with page_of(chromium, "liver", size=(1280, 800)) as page:
        choose(page, "field-select", "von_mises")
        page.keyboard.press("x")
        time.sleep(STANDS)
        press(page, 4)
        time.sleep(STANDS)
        take(page, out / "cut.png", 1)


def regions(chromium: Browser, out: Path) -> None:
    """Cut the slab of `examples/nodule.toml` open through its nodule, in the colours of its regions."""
    with page_of(chromium, str(ROOT / "examples" / "nodule.toml"), command="run") as page:
        page.get_by_test_id("field-select").select_option(label="Region")
        page.keyboard.press("x")
        time.sleep(STANDS)
        take(page, out / "regions.png", 0)


def nodule(chromium: Browser, out: Path) -> None:
    """Slide over the slab of `examples/nodule.toml` at constant depth: beside the nodule, and over it."""
    with page_of(chromium, str(ROOT / "examples" / "nodule.toml"), command="run") as page:
        # Along the top of the slab, through the middle, m.
        beside, over = (page.evaluate("p => window.palpate.project(p)", [x, 0.04, 0.04]) for x in (0.016, 0.04))
        press(page, place=beside)
        settled_depth(page)
        time.sleep(STANDS)
        take(page, out / "nodule-beside.png", 1)
        print(f"beside the nodule {state(page)['forceMagnitude']:.3f} N", end=", ")
        drag(page, beside, over, 24, 0.1)
        settled_force(page)
        take(page, out / "nodule-over.png", 1)
        print(f"over it {state(page)['forceMagnitude']:.3f} N")


def setup(chromium: Browser, out: Path) -> None:
    """Set a liver up from a surface file in mm: paint where it is held, and place a nodule."""
    mesh = palpate.models.load("liver")
    triangles = np.searchsorted(mesh.surface_nodes, mesh.surface_triangles)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "liver.stl"
        trimesh.Trimesh(1e3 * mesh.nodes[mesh.surface_nodes], triangles).export(file)
        program = Program(None, "--recordings", folder, command="run")
        try:
            empty = lambda s: s["connected"] and s["scene"] == "set up empty"  # noqa: E731
            with opened(chromium, program, (1280, 800), sharpness=1.0, ready=empty) as page:
                page.emulate_media(color_scheme="dark")
                page.get_by_test_id("file-input").set_input_files(file)
                until(page, lambda s: s["filled"])
                page.get_by_test_id("status").wait_for(state="hidden")
                page.get_by_test_id("unit-mm").click()
                page.get_by_test_id("setup-paint").click()
                for line in (((250, 560), (640, 620)), ((250, 600), (600, 650)), ((280, 530), (560, 560))):
                    page.mouse.move(*line[0])
                    page.mouse.down()
                    drag(page, *line)
                    page.mouse.up()
                time.sleep(STANDS)
                page.screenshot(path=out / "setup.png")
                page.get_by_test_id("setup-nodule").click()
                page.get_by_test_id("setup-brush").click()
                x, y = page.evaluate("p => window.palpate.project(p)", until(page, lambda s: s["nodule"])["nodule"])
                page.mouse.move(x, y)
                page.mouse.down()
                drag(page, (x, y), (x - 110, y - 40))
                page.mouse.up()
                time.sleep(STANDS)
                page.screenshot(path=out / "setup-nodule.png")
        finally:
            program.stop()


def web(chromium: Browser, out: Path) -> None:
    """Show the first page of the gallery that `make site` builds; it must be there."""
    site = ROOT / "docs" / "_site"
    if not (site / "touch.html").is_file():
        raise SystemExit(f"{site} is missing: 'make site' builds it")
    with served(site) as address:
        page = chromium.new_page(viewport={"width": 1240, "height": 720}, color_scheme="dark")
        page.goto(f"{address}/index.html")
        page.screenshot(path=out / "web.png")
        page.close()


PICTURES: dict[str, Callable[[Browser, Path], None]] = {
    "viewer": viewer,
    "two-fingers": two_fingers,
    "motion": motion,
    "tools": tools,
    "cut": cut,
    "regions": regions,
    "nodule": nodule,
    "setup": setup,
    "web": web,
}


def main() -> None:
    """Take the pictures that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[*PICTURES, []], help="which (default: all)")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images")
    given = parser.parse_args()
    before = time.time()
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        for name in given.names or PICTURES:
            PICTURES[name](chromium, given.out)
        chromium.close()
    for path in given.out.glob("*.png"):
        if path.stat().st_mtime >= before:
            shrunk(path)


if __name__ == "__main__":
    main()
