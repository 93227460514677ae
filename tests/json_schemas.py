#!/usr/bin/env python3
"""Holds what commands print with --json against docs/schemas. Usage: json_schemas.py SOURCE_DIR BIN_DIR

Starts a small cluster on this machine, calls every command that has --json, and validates what it
prints with python3-jsonschema; what a schema does not mention is a mistake here, though programs that
read the output must expect it. Exits with 77 (skipped) where python3-jsonschema is not installed.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

try:
    import jsonschema
except ImportError:
    print("python3-jsonschema is not installed")
    sys.exit(77)

SOURCE = pathlib.Path(sys.argv[1])
BIN = pathlib.Path(sys.argv[2])
SCHEMAS = SOURCE / "docs" / "schemas"


def strict(schema):
    """The schema, refusing what it does not mention."""
    if isinstance(schema, dict):
        closed = {key: strict(value) for key, value in schema.items()}
        if "properties" in closed and "additionalProperties" not in closed:
            closed["additionalProperties"] = False
        return closed
    return [strict(entry) for entry in schema] if isinstance(schema, list) else schema


class Outputs:
    """Calls commands and compares what they print."""

    def __init__(self, folder):
        self.folder = folder
        self.schemas = {path.name: json.loads(path.read_text()) for path in SCHEMAS.glob("*.json")}
        self.store = {name: strict(schema) for name, schema in self.schemas.items()}
        self.used = set()
        self.covered = set()
        self.mistakes = []

    def check(self, schema, *arguments, codes=(0,)):
        """Calls `weft ARGUMENTS --json` and returns what it printed."""
        command = [str(BIN / "weft"), *map(str, arguments), "--json"]
        ended = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, timeout=120)
        line = "weft " + " ".join(map(str, arguments))
        if ended.returncode not in codes:
            self.mistakes.append(f"{line}: ended with {ended.returncode}: {ended.stderr}")
            return None
        try:
            value = json.loads(ended.stdout)
        except ValueError as error:
            self.mistakes.append(f"{line}: not one JSON value: {error}: {ended.stdout[:200]}")
            return None
        self.validate(schema, value, line)
        self.covered.add(" ".join(str(word) for word in arguments))
        return value

    def validate(self, schema, value, line):
        name = schema + ".json"
        self.used.add(name)
        resolver = jsonschema.RefResolver("", self.store[name], store=self.store)
        validator = jsonschema.Draft202012Validator(self.store[name], resolver=resolver)
        for error in validator.iter_errors(value):
            place = "/".join(map(str, error.absolute_path))
            self.mistakes.append(f"{line}: {name}: /{place}: {error.message[:300]}")


def commands_with_json():
    """Those of `weft --help` whose help has --json, certs' own commands among them."""
    found = set()

    def look(path):
        text = subprocess.run([BIN / "weft", *path, "--help"], capture_output=True, text=True,
                              check=True).stdout
        if "--json" in text.split("Options:")[-1]:
            found.add(" ".join(path))
        in_list = False
        for text_line in text.splitlines():
            in_list = text_line.endswith(":") and text_line not in ("Options:", "Arguments:",
                                                                    "Examples:", "Example:") \
                if not text_line.startswith(" ") and text_line else in_list
            words = text_line.split()
            if in_list and text_line.startswith("  ") and not text_line.startswith("   "):
                look([*path, words[0]])

    look([])
    return found


def check_files(outputs, tiny):
    """Commands that need no coordinator."""
    check = outputs.check
    check("new", "new", "--preset", "silk", "-o", "silk.textproto")
    check("new-text", "new", "--preset", "silk")
    check("presets", "new", "--list")
    wif = outputs.folder / "plain.wif"
    wif.write_text("[WIF]\nVersion=1.1\nDate=April 20, 1997\nDevelopers=x@y.z\nSource Program=x\n"
                   "[CONTENTS]\nWEAVING=1\nWARP=1\nWEFT=1\nTHREADING=1\nTIEUP=1\nTREADLING=1\n"
                   "[WEAVING]\nShafts=2\nTreadles=2\n[WARP]\nThreads=2\n[WEFT]\nThreads=2\n"
                   "[THREADING]\n1=1\n2=2\n[TIEUP]\n1=1\n2=2\n[TREADLING]\n1=1\n2=2\n")
    check("import", "import", wif, "-o", "plain.textproto")
    check("preview", "preview", tiny, "-o", "tiny.png", "--pixels", "32")
    check("export", "export", tiny, "-o", "tiny.obj")
    check("export", "export", tiny, "-o", "tiny.bcc")
    check("import-curves", "import", "tiny.bcc", "--as", "fibres", "--period", "1,1",
          "--radius-mm", "0.01", "-o", "curves.textproto")
    check("estimate", "run", tiny, "--dry-run")
    check("run", "run", tiny, "-o", "tiny.h5", "--quality", "preview")
    check("inspect", "inspect", "tiny.h5")
    check("recolor", "recolor", "tiny.h5", "--yarn", "all=#7a1f2b", "-o", "claret.h5")
    check("maps", "maps", "tiny.h5", "-o", "maps", "--size", "8", "--samples", "1")
    check("verify", "verify", "tiny.h5")
    (outputs.folder / "damaged.h5").write_bytes(b"x" * 4096)
    check("verify", "verify", "damaged.h5", codes=(1,))
    for name in ("a", "b"):
        check("render", "render", "tiny.h5", "--device", "cpu", "--size", "16x16", "--spp", "1",
              "-o", name + ".exr")
    check("compare", "compare", "a.exr", "b.exr")
    check("devices", "render", "--list-devices", codes=(0,))
    check("certificate-authority", "certs", "init", "--authority", "authority")
    check("certificate", "certs", "issue", "ann", "--role", "reader", "--authority", "authority")
    check("certificates", "certs", "list", "--authority", "authority")
    check("revoked", "certs", "revoke", "ann", "--authority", "authority")
    check("config", "config", "show")
    check("doctor", "doctor", codes=(0, 1))
    check("fetch-import", "fetch", "--import", "tiny.h5", "-o", "taken.h5")


def check_cluster(outputs, tiny):
    """Commands that talk to a coordinator."""
    check = outputs.check
    check("jobs", "jobs")
    job = check("submit", "submit", tiny, "--quality", "preview", "--wait", "-o", "fetched.h5")
    if job is None:
        return
    check("jobs", "jobs")
    check("job", "watch", job["id"])
    paused = check("submit", "submit", tiny, "--quality", "paper")
    for order in ("pause", "resume", "cancel", "retry", "pause"):
        check("job", order, paused["id"])
    check("job", "priority", paused["id"], "7")
    check("explanation", "explain", "job", paused["id"])
    check("job", "cancel", paused["id"])
    check("attempts", "logs", job["id"], "--list")
    workers = check("workers", "workers")
    check("explanation", "explain", "worker", workers[0]["name"])
    check("workers", "drain", workers[0]["name"])
    check("workers", "drain", workers[0]["name"], "--undo")
    check("workers", "unblock", workers[0]["name"])
    check("fabrics", "fabrics")
    check("versions", "versions", "tiny")
    check("version", "tag", "tiny@1", "good")
    check("version", "untag", "tiny:good")
    check("history", "log", "tiny")
    check("diff", "diff", "tiny@1", "tiny@1")
    check("fetch", "fetch", "tiny@1", "-o", "again.h5")
    text = (outputs.folder / tiny).read_text().replace("seed: ", "seed: 9")
    (outputs.folder / "other.textproto").write_text(text)
    check("submit", "submit", "other.textproto", "--quality", "preview", "--wait")
    check("diff", "diff", "tiny@1", "tiny@2")
    check("version", "rollback", "tiny@1")
    check("history", "log", "tiny")
    check("garbage", "gc", "--dry-run")


def main():
    for name in ("WEFT_COORDINATOR", "WEFT_CONFIG", "WEFT_TLS_FOLDER"):
        os.environ.pop(name, None)
    os.environ["WEFT_SYSTEM_CONFIG"] = ""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        os.environ["XDG_CONFIG_HOME"] = name
        os.environ["XDG_CACHE_HOME"] = name
        outputs = Outputs(folder)
        (folder / "tiny.textproto").write_text((SOURCE / "examples/tiny.textproto").read_text())
        check_files(outputs, "tiny.textproto")
        up = subprocess.Popen([BIN / "weft", "up", "--workers", "1", "--threads", "2", "--listen",
                               "127.0.0.1:0", "--state", folder / "state", "--json"],
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            lines = ""
            while not lines.endswith("\n}\n"):
                line = up.stdout.readline()
                if not line:
                    break
                lines += line
            started = json.loads(lines)
            outputs.validate("up", started, "weft up")
            outputs.covered.add("up")
            os.environ["WEFT_COORDINATOR"] = started["coordinator"]
            check_cluster(outputs, "tiny.textproto")
        finally:
            up.terminate()
            up.wait(30)
    for command in sorted(commands_with_json()):
        if not any((line + " ").startswith(command + " ") for line in outputs.covered):
            outputs.mistakes.append(f"weft {command}: it has --json, and is not called here")
    unused = set(outputs.schemas) - outputs.used - {"definitions.json"}
    outputs.mistakes += [f"docs/schemas/{name}: no output is held against it" for name in unused]
    for mistake in outputs.mistakes:
        print(mistake)
    print(f"{len(outputs.covered)} outputs, {len(outputs.used)} schemas")
    return 1 if outputs.mistakes else 0


sys.exit(main())
