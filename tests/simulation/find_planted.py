#!/usr/bin/env python3
"""Fails unless the simulation finds a planted bug, and nothing without it.

find_planted.py PLANTED SOUND SEEDS. The program PLANTED must go wrong in one of its first SEEDS
seeds; the program SOUND, which is the same without the bug, must not in that one.
"""

import re
import subprocess
import sys


def main():
    planted, sound, seeds = sys.argv[1:]
    search = subprocess.run([planted, "--find", "--seeds", seeds], stdout=subprocess.PIPE, text=True)
    print(search.stdout, end="", flush=True)
    found = re.search(r"^seed (\d+) goes wrong", search.stdout, re.MULTILINE)
    if search.returncode != 0 or not found:
        sys.exit(f"{planted} finds nothing in {seeds} seeds")
    replay = subprocess.run([sound, "--first", found[1], "--seeds", "1"])
    if replay.returncode != 0:
        sys.exit(f"seed {found[1]} goes wrong without the planted bug, too")


main()
