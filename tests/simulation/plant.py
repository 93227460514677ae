#!/usr/bin/env python3
"""Writes a copy of a source file with one line changed: a bug that the simulation must find.

plant.py SOURCE OLD NEW COPY. OLD must occur exactly once. Where it does not, the copy is the file
as it is, so that the build goes on and the test of that bug, which finds nothing, says so.
"""

import pathlib
import sys


def main():
    source, old, new, copy = sys.argv[1:]
    text = pathlib.Path(source).read_text()
    if text.count(old) == 1:
        text = text.replace(old, new)
    else:
        print(f"plant.py: '{old}' occurs {text.count(old)} times in {source}; nothing is planted")
    pathlib.Path(copy).write_text(text)


main()
