#!/usr/bin/env python3
"""Precomputes fabrics and prints the table of docs/performance.md.

    bench/fabrics.py OUT_DIR [--quality preview|paper|best] [--threads N] FABRIC.textproto ...

Every database is kept in OUT_DIR with its times beside it and not made again.
"""

import argparse
import json
import pathlib
import resource
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
WEFT = ROOT / "build" / "bin" / "weft"


def precompute(description, database, quality, threads):
    times = database.with_suffix(".times.json")
    if not (database.exists() and times.exists()):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        start = time.monotonic()
        subprocess.run([WEFT, "run", description, "-o", database, "--quality", quality,
                        "--threads", str(threads)], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.write_text(json.dumps({"cpu_seconds": after.ru_utime - before.ru_utime,
                                     "wall_seconds": time.monotonic() - start}))
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
            f"{100 * about['ssdf_sign_error']:.1f} %", f"{times['cpu_seconds']:.0f} s"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("fabrics", nargs="+", type=pathlib.Path)
    parser.add_argument("--quality", default="preview", choices=["preview", "paper", "best"])
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    print("| fabric | fibres | segments | mean free path, mm | cells | SH order | paths per cell | "
          "transfer, MB | SSDF, MB | SGs, MB | file, MB | blocked | wrong signs | CPU time |")
    print("|---" * 14 + "|")
    for description in arguments.fabrics:
        database = arguments.out / f"{description.stem}-{arguments.quality}.h5"
        times = precompute(description, database, arguments.quality, arguments.threads)
        print("| " + " | ".join(row(database, times)) + " |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
