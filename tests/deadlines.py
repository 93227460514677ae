#!/usr/bin/env python3
"""Fails when a file makes more calls than it sets deadlines: a call without one may wait for ever.

Usage: deadlines.py SOURCE_DIR
"""

import pathlib
import re
import sys

FOLDERS = ["client", "cli", "worker", "coordinator", "render", "security"]
CONTEXT = re.compile(r"grpc::ClientContext \w+;")
DEADLINE = re.compile(r"set_deadline\(")


def main():
    root = pathlib.Path(sys.argv[1])
    calls = 0
    mistakes = 0
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix not in {".h", ".cpp"}:
                continue
            text = path.read_text()
            contexts = len(CONTEXT.findall(text))
            deadlines = len(DEADLINE.findall(text))
            calls += contexts
            if contexts > deadlines:
                mistakes += 1
                print(f"{path.relative_to(root)}: {contexts} calls, {deadlines} deadlines")
    if calls == 0:
        print(f"no calls under {root}")
    return 1 if mistakes or calls == 0 else 0


sys.exit(main())
