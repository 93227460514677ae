#!/usr/bin/env python3
"""Precomputes fabrics and prints the tables of docs/performance.md.

    bench/fabrics.py OUT_DIR [--quality preview|paper|best] [--threads N] FABRIC.textproto ...

Every database is kept in OUT_DIR with its times beside it and not made again. Times are seconds of
processor time of all threads, but for those that are called wall.
"""

import argparse
import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
STAGES = ["geometry", "grid", "visibility", "basis", "coefficients", "shadow", "transfer"]
WEFT = ROOT / "build" / "bin" / "weft"


# Khungurn et al. 2017, table 1: minutes of wall time on 192 cores, sizes in MB.
PAPER = {
    "fleece": {"segments": 580660, "transfer": 5.67, "visibility": 79.79},
    "gabardine": {"segments": 120121, "transfer": 5.25, "visibility": 15.51},
    "silk_plain": {"segments": 112294, "transfer": 2.19, "visibility": 15.07},
    "satin_4_1": {"segments": 318882, "transfer": 8.44, "visibility": 41.33},
    "satin_2_3": {"segments": 244420, "transfer": 5.03, "visibility": 31.25},
    "satin_1_4": {"segments": 290149, "transfer": 5.57, "visibility": 37.90},
    "shot_silk_a": {"segments": 75550, "transfer": 9.75, "visibility": 7.98},
    "shot_silk_b": {"segments": 56518, "transfer": 9.43, "visibility": 7.18},
}


def precompute(description, database, quality, threads):
    times = database.with_suffix(".times.json")
    if not (database.exists() and times.exists()):
        made = subprocess.run([WEFT, "run", description, "-o", database, "--quality", quality,
                               "--threads", str(threads), "--json"], check=True, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout
        times.write_text(made)
    return json.loads(times.read_text())


def row(database, times):
    about = json.loads(subprocess.run([WEFT, "inspect", database, "--json"], check=True,
                                      stdout=subprocess.PIPE, text=True).stdout)
    sizes = {section["section"]: section["bytes"] for section in about["sections"]}
    return [about["name"], f"{about['fibres']:,}", f"{about['segments']:,}",
            f"{about['mean_free_path_mm']:.4f}", f"{about['cells']:,}", str(about["sh_order"]),
            f"{about['paths_per_cell']['most']:,}", f"{sizes['/iirtf'] / 1e6:.1f}",
            f"{sizes['/visibility/ssdf'] / 1e6:.1f}", f"{sizes['/visibility/ssg'] / 1e6:.1f}",
            f"{about['bytes'] / 1e6:.1f}", f"{100 * about['blocked_segments_share']:.0f} %",
            f"{100 * about['ssdf_sign_error']:.2f} %", f"{times['cpu_seconds']:.0f} s"]


def stage_row(database, times):
    """Where the time goes, beside the paper's two columns."""
    cpu = {stage["name"]: stage["cpu_seconds"] for stage in times["stages"]}
    visibility = cpu["visibility"] + cpu["basis"] + cpu["coefficients"]
    paper = PAPER.get(database.stem.rsplit("-", 1)[0])
    theirs = [f"{paper['segments']:,}", f"{paper['visibility'] * 60:.0f}",
              f"{paper['transfer'] * 60:.0f}"] if paper else ["", "", ""]
    return ([times["fabric"]] + [f"{cpu[name]:.1f}" for name in STAGES]
            + [f"{times['merge_seconds']:.1f}", f"{times['idle_thread_seconds']:.1f}",
               f"{times['seconds']:.0f}", f"{times['peak_memory_bytes'] / 2**30:.2f}",
               f"{visibility:.0f}", *theirs])


def print_table(columns, rows):
    print("| " + " | ".join(columns) + " |\n" + "|---" * len(columns) + "|")
    for line in rows:
        print("| " + " | ".join(line) + " |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("fabrics", nargs="+", type=pathlib.Path)
    parser.add_argument("--quality", default="preview", choices=["preview", "paper", "best"])
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    made = []
    for description in arguments.fabrics:
        database = arguments.out / f"{description.stem}-{arguments.quality}.h5"
        made.append((database, precompute(description, database, arguments.quality,
                                          arguments.threads)))
        print(f"{database}: {made[-1][1]['seconds']:.0f} s", file=sys.stderr)
    print_table(["fabric", "fibres", "segments", "mean free path, mm", "cells", "SH order",
                 "paths per cell", "transfer, MB", "SSDF, MB", "SGs, MB", "file, MB", "blocked",
                 "wrong signs", "CPU time"], (row(*one) for one in made))
    print()
    print_table(["fabric", *STAGES, "merge (wall)", "idle threads", "wall", "memory, GiB",
                 "visibility in all", "the paper's segments", "its visibility (wall, 192 cores)",
                 "its transfer (wall, 192 cores)"], (stage_row(*one) for one in made))


if __name__ == "__main__":
    sys.exit(main())
