#!/usr/bin/python3
"""Opens the status page over mutual TLS in headless Chromium, with a person's certificate and without.

Usage: page_browser_tls.py BIN_DIR [SCREENSHOTS]
Exits with 77 (skipped) where chromium, its driver, selenium or certutil is not installed.
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

SKIPPED = 77
WAIT_S = 60
WORD = "indigo"


def skip(why):
    print(f"skipped: {why}; deploy/install_packages.sh installs it")
    sys.exit(SKIPPED)


try:
    from selenium import webdriver
    from selenium.common.exceptions import WebDriverException
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.support.ui import WebDriverWait
except ImportError:
    skip("python3-selenium is not there")

for program in ["chromium", "chromedriver", "certutil", "pk12util", "openssl"]:
    if not shutil.which(program):
        skip(f"{program} is not there")


def check(truth, what):
    if not truth:
        raise AssertionError(what)


class House:
    """An authority, and a coordinator whose page speaks TLS."""

    def __init__(self, bin_dir, folder):
        self.bin, self.folder = bin_dir, folder
        authority = ["--authority", folder / "authority"]
        self.weft("certs", "init", *authority)
        self.weft("certs", "issue", "hub", "--host", "localhost", "--out", folder / "hub", *authority)
        self.weft("certs", "issue", "ann", "--role", "reader", "--out", folder / "ann", *authority)
        self.weft("certs", "issue", "loom", "--role", "worker", "--out", folder / "loom", *authority)
        self.process = subprocess.Popen(
            [bin_dir / "weft-coordinator", "--listen", "0.0.0.0:0", "--http", "0.0.0.0:0", "--state", folder / "state",
             "--tls-folder", folder / "hub"],
            stdout=subprocess.PIPE, stderr=open(folder / "coordinator.log", "ab"), text=True)
        self.process.stdout.readline()
        address = self.process.stdout.readline().split(" at ")[1].strip()
        check(address.startswith("https://"), f"the page is at {address}")
        self.url = f"https://localhost:{address.rstrip('/').rsplit(':', 1)[1]}/"

    def weft(self, *arguments):
        subprocess.run([self.bin / "weft", *arguments], check=True, stdout=subprocess.DEVNULL)

    def close(self):
        self.process.kill()
        self.process.wait()


def home_of(name, house):
    """A home folder whose browser trusts the authority and has the certificate of `name`, if it is not empty: the
    commands of docs/status_page.md."""
    home = house.folder / f"home-{name or 'nobody'}"
    store = home / ".pki/nssdb"
    store.mkdir(parents=True)
    nss = f"sql:{store}"
    run = lambda *command: subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    run("certutil", "-d", nss, "-N", "--empty-password")
    run("certutil", "-d", nss, "-A", "-n", "weft", "-t", "C,,", "-i", house.folder / "ann/ca.pem")
    if name:
        bundle = home / f"{name}.p12"
        run("openssl", "pkcs12", "-export", "-in", house.folder / name / "cert.pem", "-inkey",
            house.folder / name / "key.pem", "-out", bundle, "-passout", f"pass:{WORD}")
        run("pk12util", "-d", nss, "-i", bundle, "-W", WORD)
    return home


def browser_of(home, url):
    options = Options()
    options.binary_location = shutil.which("chromium")
    for argument in ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
                     "--window-size=1280,900", f"--user-data-dir={home}/profile"]:
        options.add_argument(argument)
    # Nobody is there to choose a certificate: what AutoSelectCertificateForUrls sets.
    rule = json.dumps({"pattern": url.rstrip("/"), "filter": {}})
    options.add_experimental_option("prefs", {"profile.managed_auto_select_certificate_for_urls": [rule]})
    environment = {**os.environ, "HOME": str(home)}
    return webdriver.Chrome(service=Service(shutil.which("chromedriver"), env=environment), options=options)


def text_of(driver):
    return driver.execute_script("return document.body ? document.body.innerText : ''")


def opened(driver, url):
    """What the browser shows of the page, or why it does not."""
    try:
        driver.get(url)
    except WebDriverException as failure:
        return failure.msg
    return text_of(driver)


def look_with_a_certificate(house, screenshots):
    driver = browser_of(home_of("ann", house), house.url)
    try:
        shown = opened(driver, house.url)
        WebDriverWait(driver, WAIT_S).until(lambda _: "Live" in text_of(driver),
                                            f"the page should be live; it has: {shown[:500]}")
        check("Nothing is to be done" in text_of(driver), f"the jobs should be shown: {text_of(driver)[:500]}")
        if screenshots:
            driver.save_screenshot(str(screenshots / "tls.png"))
        # Open streams end, too, when the certificate is revoked.
        house.weft("certs", "revoke", "ann", "--authority", house.folder / "authority")
        WebDriverWait(driver, WAIT_S).until(lambda _: "Live" not in text_of(driver),
                                            "a revoked certificate should lose the page")
        if screenshots:
            driver.save_screenshot(str(screenshots / "tls_revoked.png"))
    finally:
        driver.quit()


def look_without_one(house):
    driver = browser_of(home_of("", house), house.url)
    try:
        shown = opened(driver, house.url)
        # The handshake is refused; whether the browser still hears why depends on who closes first.
        check("ERR_" in shown and "ERR_CONNECTION_REFUSED" not in shown and "ERR_CERT" not in shown,
              f"without a certificate the handshake should be refused; the browser shows: {shown[:500]}")
    finally:
        driver.quit()


def look_with_a_role_that_may_not(house):
    driver = browser_of(home_of("loom", house), house.url)
    try:
        shown = opened(driver, house.url)
        check("permission_denied" in shown, f"a worker should be refused; the browser shows: {shown[:500]}")
    finally:
        driver.quit()


def main():
    bin_dir = pathlib.Path(sys.argv[1])
    screenshots = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
    if screenshots:
        screenshots.mkdir(parents=True, exist_ok=True)
    folder = pathlib.Path(tempfile.mkdtemp(prefix="weft-page-tls-"))
    house = None
    try:
        house = House(bin_dir, folder)
        look_without_one(house)
        look_with_a_role_that_may_not(house)
        look_with_a_certificate(house, screenshots)
    finally:
        if house:
            house.close()
        shutil.rmtree(folder, ignore_errors=True)


main()
