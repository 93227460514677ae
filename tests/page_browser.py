#!/usr/bin/python3
"""Uses the status page as a person would, in headless Chromium, with a real cluster behind it.

Usage: page_browser.py SOURCE_DIR BIN_DIR [SCREENSHOTS]
Exits with 77 (skipped) where chromium, its driver or selenium is not installed.
"""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

SKIPPED = 77
WAIT_S = 300
MARKUP = "<img src=x onerror=alert(1)>"
STAGES = 7


def skip(why):
    print(f"skipped: {why}; deploy/install_packages.sh installs it")
    sys.exit(SKIPPED)


try:
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import WebDriverWait
except ImportError:
    skip("python3-selenium is not there")


class Cluster:
    """A coordinator with its page, a worker and a render node, of this test's own."""

    def __init__(self, bin_dir, folder):
        self.bin, self.folder, self.processes = bin_dir, folder, {}
        self.node_address = f"unix:{folder}/render"
        self.listen, self.http = "127.0.0.1:0", "127.0.0.1:0"
        self.start_coordinator()
        self.start("worker", "weft-worker", "--coordinator", self.address, "--name", "loom", "--threads", "1",
                   "--scratch", f"{folder}/scratch")
        self.start_node()

    def start(self, name, program, *arguments):
        log = open(self.folder / f"{name}.log", "ab")
        self.processes[name] = subprocess.Popen([self.bin / program, *arguments], stdout=subprocess.PIPE, stderr=log,
                                                text=True)
        return self.processes[name]

    def start_coordinator(self):
        process = self.start("coordinator", "weft-coordinator", "--listen", self.listen, "--http", self.http,
                             "--state", f"{self.folder}/state", "--render-node", self.node_address)
        self.address = process.stdout.readline().split(" at ")[1].strip()
        self.url = process.stdout.readline().split(" at ")[1].strip()
        self.listen, self.http = self.address, self.url.split("/")[2]  # when it is started again

    def start_node(self):
        self.start("node", "weft-render", "--listen", self.node_address, "--coordinator", self.address, "--cache",
                   f"{self.folder}/cache", "--device", "cpu", "--threads", "2").stdout.readline()

    def stop(self, name):
        process = self.processes.pop(name)
        process.kill()
        process.wait()

    def submit(self, source, comment, paths):
        text = (source / "examples/tiny.textproto").read_text().replace("paths_per_cell: 512", f"paths_per_cell: {paths}")
        description = self.folder / f"tiny{paths}.textproto"
        description.write_text(text)
        subprocess.run([self.bin / "weft", "submit", description, "--comment", comment, "--coordinator", self.address],
                       check=True, stdout=subprocess.DEVNULL)

    def close(self):
        for name in list(self.processes):
            self.stop(name)


class Browser:
    def __init__(self, screenshots):
        chromium = shutil.which("chromium")
        driver = shutil.which("chromedriver")
        if not chromium or not driver:
            skip("chromium or chromium-driver is not there")
        options = Options()
        options.binary_location = chromium
        for argument in ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--window-size=1280,900"]:
            options.add_argument(argument)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(service=Service(driver), options=options)
        self.screenshots = screenshots

    def until(self, what, condition):
        try:
            return WebDriverWait(self.driver, WAIT_S, poll_frequency=0.2,
                                 ignored_exceptions=[Exception]).until(lambda _: condition())
        except Exception as failure:
            self.shoot("failure")
            raise AssertionError(f"{what}; the page has: {self.text()[:2000]}") from failure

    def one(self, selector):
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def all(self, selector):
        return self.driver.find_elements(By.CSS_SELECTOR, selector)

    def text(self, selector="body"):
        return self.one(selector).text

    def says(self, text, selector="body"):
        self.until(f"{selector} should say '{text}'", lambda: text in self.text(selector))

    def script(self, code, *arguments):
        return self.driver.execute_script(code, *arguments)

    def media(self, scheme):
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia",
                                    {"features": [{"name": "prefers-color-scheme", "value": scheme}]})

    def width(self, width, height=900):
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                                    {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600})

    def shoot(self, name):
        if self.screenshots:
            self.driver.save_screenshot(str(self.screenshots / f"{name}.png"))

    def complaints(self):
        """What the browser has against the page: broken scripts, a policy that was not kept."""
        return [entry["message"] for entry in self.driver.get_log("browser")
                if entry["level"] == "SEVERE" and "Failed to load resource" not in entry["message"]]

    def picture(self):
        """The swatch that is shown, as the mean colours of its sixteen parts."""
        return self.script("""
            const image = document.querySelector('.frame img');
            const canvas = document.createElement('canvas');
            canvas.width = canvas.height = 64;
            const context = canvas.getContext('2d');
            context.drawImage(image, 0, 0, 64, 64);
            const { data } = context.getImageData(0, 0, 64, 64);
            const means = new Array(48).fill(0);
            for (let at = 0; at < 4096; ++at) {
              const part = (at >> 10) * 4 + ((at & 63) >> 4);
              for (let c = 0; c < 3; ++c) means[3 * part + c] += data[4 * at + c] / 256;
            }
            return means;""")

    def settled(self):
        """Waits until the fine picture of what is set now is there."""
        self.until("a picture should be drawn", lambda: self.one(".frame").get_attribute("data-state") == "drawn")
        return self.picture()


# Of mean colours, from 0 to 255. Pictures of one view differ by their grain.
SAME, DIFFERENT = 10, 15


def difference(one, other):
    return sum(abs(a - b) for a, b in zip(one, other)) / len(one)


def check(truth, what):
    if not truth:
        raise AssertionError(what)


def watch_a_job(browser, cluster, source):
    browser.driver.get(cluster.url)
    browser.says("Nothing is to be done", ".summary")
    browser.says("Live", "#connection")
    cluster.submit(source, f"autumn {MARKUP}", 3000)
    # It appears by itself, and moves.
    browser.until("the job should appear", lambda: browser.all("[data-job]"))
    browser.until("a stage should be done", lambda: browser.all(".strip [data-state=done]"))
    browser.shoot("jobs")
    check(MARKUP in browser.text(".jobs .comment"), "a comment is text, whatever it holds")
    check(not browser.all("main img[src=x]"), "markup of a comment became an element")
    browser.one(".jobs .name").click()
    browser.until("the job's page should open", lambda: browser.text("h1") == "tiny")
    browser.until("its stages should be there", lambda: len(browser.all(".stages tbody tr")) == STAGES)
    browser.until("it should say why it moves", lambda: len(browser.text(".summary")) > 10)
    browser.until("attempts should be listed", lambda: browser.all(".attempts > li"))
    browser.shoot("job")
    browser.says("succeeded", ".title .chip")
    browser.says("tiny@1")


def read_a_log(browser):
    browser.until("attempts should be over", lambda: browser.all(".attempts .chip[data-state=succeeded]"))
    # By the keyboard alone.
    summary = browser.one(".attempts summary")
    browser.script("arguments[0].focus()", summary)
    summary.send_keys(Keys.ENTER)
    browser.until("a log should open", lambda: len(browser.text(".attempts details[open] .log")) > 5)
    stage = browser.one("#stage")
    stage.send_keys("geometry")
    browser.until("attempts of one stage should be left", lambda: len(browser.all(".attempts > li")) == 1)
    browser.one("#shard").send_keys("5", Keys.TAB)
    browser.says("No attempt is known", "main")


def look_at_workers(browser):
    browser.one("[data-section=workers]").click()
    browser.says("1 worker with 1 thread", ".summary")
    browser.says("loom", ".workers")
    browser.one(".workers .link").click()
    browser.until("it should say why it is idle", lambda: len(browser.text(".workers .verdict")) > 3)
    browser.shoot("workers")


def look_at_fabrics(browser, cluster, source):
    cluster.submit(source, "finer", 3100)
    browser.one("[data-section=fabrics]").click()
    browser.until("a thumbnail should be drawn", lambda: browser.script(
        "const i = document.querySelector('.fabrics .thumbnail img'); return i && i.complete && i.naturalWidth > 0"))
    browser.says("2 versions", ".fabrics")
    browser.until("the new version's thumbnail should be drawn", lambda: browser.script(
        "const i = document.querySelector('.fabrics .thumbnail img'); return i && i.complete && i.naturalWidth > 0"))
    browser.shoot("fabrics")
    browser.one(".fabrics .name").click()
    browser.until("both versions should be listed", lambda: len(browser.all(".versions > li .thumbnail img")) == 2)
    browser.one(".versions .link").click()
    browser.says("paths_per_cell", ".versions")
    browser.says("/iirtf/", ".versions")
    browser.shoot("fabric")


def turn_a_swatch(browser):
    browser.one(".versions a.name").click()
    first = browser.settled()
    browser.shoot("version")
    slider = browser.one("#swatch-light_elevation")
    before = slider.get_attribute("value")
    slider.send_keys(Keys.HOME)
    check(slider.get_attribute("value") != before, "the slider does not take keys")
    low = browser.settled()
    check(difference(low, first) > DIFFERENT, f"light from low makes no difference: {low} {first}")
    browser.one(".reset").click()
    check(slider.get_attribute("value") == before, "as it was, but it is not")
    browser.one("input[value=single]").click()
    single = browser.settled()
    browser.one("input[value=multiple]").click()
    multiple = browser.settled()
    check(difference(single, multiple) > DIFFERENT, f"scattering makes no difference: {single} {multiple}")
    browser.one("#swatch-sharpness").send_keys(Keys.END)
    browser.says("parallel", ".controls")
    browser.one(".reset").click()
    again = browser.settled()
    check(difference(again, first) < SAME, f"as it was, but it is not: {again} {first}")
    check(" s on " in browser.text(".status"), "how long it took is not said")


def do_without(browser, cluster):
    cluster.stop("node")
    browser.one("#swatch-camera_elevation").send_keys(Keys.ARROW_RIGHT)
    browser.says("does not answer", ".status")
    browser.shoot("node_away")
    cluster.start_node()
    browser.one("#swatch-camera_elevation").send_keys(Keys.ARROW_RIGHT)
    browser.until("the node should draw again", lambda: " s on " in browser.text(".status"))
    cluster.stop("coordinator")
    browser.says("does not answer", "#connection")
    cluster.start_coordinator()
    browser.says("Live", "#connection")


def ask_why_it_waits(browser, cluster, source):
    cluster.stop("worker")
    cluster.submit(source, "waits", 3200)
    browser.one("[data-section=jobs]").click()
    browser.until("the waiting job should be first", lambda: "waits" in browser.text(".jobs .comment"))
    browser.one(".jobs .name").click()
    browser.until("it should say why it waits and what to do",
                  lambda: "weft-worker" in browser.text(".reasons") or "weft workers" in browser.text(".reasons"))
    browser.one("#stage").send_keys("geometry")
    browser.one("#shard").send_keys("0", Keys.TAB)
    browser.until("a task should be explained", lambda: "Geometry 0: " in browser.text(".verdict:not(:empty)"))
    browser.shoot("waits")


def fit_every_page(browser, cluster):
    pages = ["", "workers", "fabrics", "fabrics/tiny", "fabrics/tiny/1"]
    jobs = browser.script("return fetch('api/jobs').then((a) => a.json()).then((j) => j.jobs.map((job) => job.id))")
    pages.append(f"jobs/{jobs[0]}")
    colours = set()
    for scheme in ["light", "dark"]:
        browser.media(scheme)
        colours.add(browser.script("return getComputedStyle(document.documentElement).backgroundColor"))
        for width in [360, 1280]:
            browser.width(width, 760 if width < 600 else 900)
            for page in pages:
                browser.script("location.hash = arguments[0]", f"#/{page}")
                browser.until("the page should be there", lambda: browser.all("main h1"))
                if page.startswith("fabrics/tiny/"):
                    browser.until("a picture should be drawn", lambda: browser.one(".frame img").is_displayed())
                time.sleep(0.5)
                wide = browser.script("return document.documentElement.scrollWidth")
                browser.shoot(f"{scheme}_{width}_{page.replace('/', '_')[:14] or 'all'}")
                check(wide <= width, f"{page or 'jobs'} is {wide} wide at {width}")
    check(len(colours) == 2, "light and dark look the same")


def walk_by_keyboard(browser, cluster):
    browser.width(1280)
    browser.driver.get(cluster.url)
    browser.until("the jobs should be there", lambda: browser.all(".jobs .name"))
    seen = []
    for _ in range(8):
        browser.driver.switch_to.active_element.send_keys(Keys.TAB)
        seen.append(browser.script("return document.activeElement.textContent.trim()"))
    check(seen[0].startswith("Skip") and seen[1:5] == ["weft", "Jobs", "Workers", "Fabrics"], f"tab leads to {seen}")
    check("tiny" in seen, f"no job is reached by tab: {seen}")
    outline = browser.script("return getComputedStyle(document.activeElement).outlineStyle")
    check(outline != "none", "one does not see what is focused")


def main():
    source, bin_dir = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    screenshots = pathlib.Path(sys.argv[3]) if len(sys.argv) > 3 else None
    if screenshots:
        screenshots.mkdir(parents=True, exist_ok=True)
    browser = Browser(screenshots)
    folder = pathlib.Path(tempfile.mkdtemp(prefix="weft-page-"))
    os.environ["XDG_CACHE_HOME"] = str(folder / "home-cache")
    cluster = None
    try:
        cluster = Cluster(bin_dir, folder)
        watch_a_job(browser, cluster, source)
        read_a_log(browser)
        look_at_workers(browser)
        look_at_fabrics(browser, cluster, source)
        turn_a_swatch(browser)
        complaints = browser.complaints()
        check(not complaints, f"the browser complains: {complaints}")
        do_without(browser, cluster)
        ask_why_it_waits(browser, cluster, source)
        fit_every_page(browser, cluster)
        walk_by_keyboard(browser, cluster)
        complaints = browser.complaints()
        check(not complaints, f"the browser complains: {complaints}")
    finally:
        browser.driver.quit()
        if cluster:
            cluster.close()
        shutil.rmtree(folder, ignore_errors=True)


main()
