"""Weft's own programs, for what is not Python's business."""

import os
import pathlib
import shutil
import subprocess

from . import errors


def find(name):
    """The program's path: in WEFT_BIN, on the PATH, or in the build folder that is here."""
    root = pathlib.Path(__file__).resolve().parents[2]
    folders = [os.environ.get("WEFT_BIN"), None, str(root / "build" / "bin"), str(root / "bin")]
    for folder in folders:
        if folder != "" and (found := shutil.which(name, path=folder)):
            return found
    raise errors.NotFound(f"the program {name} is not on the PATH; install it, or name the folder that "
                          "holds it in WEFT_BIN")


def run(name, *arguments, given=None):
    """Standard output of a program. Raises its message as the exception of its exit code."""
    done = subprocess.run([find(name), *arguments], input=given, capture_output=True, text=True)
    if done.returncode != 0:
        raise errors.from_exit_code(done.returncode, done.stderr.strip().removeprefix(f"{name}: "))
    return done.stdout
