#!/usr/bin/env python3
"""How the time of a job changes with cores, workers and segments; tables of docs/performance.md.

    bench/scaling.py cores OUT_DIR FABRIC.textproto ...     one thread, then two
    bench/scaling.py workers OUT_DIR FABRIC.textproto ...   a cluster of one worker, all of it on one
                                                            core, the same with a core for the
                                                            coordinator, and one of two workers
    bench/scaling.py sizes OUT_DIR FABRIC.textproto         ever more repeats of one weave

Each pair must give one content, or the command fails. Wants idle cores: times are wall times,
but for those that are called CPU.
"""

import argparse
import collections
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
WEFT = ROOT / "build" / "bin" / "weft"


def print_row(cells):
    print("| " + " | ".join(cells) + " |", flush=True)


def print_head(columns):
    print_row(columns)
    print("|---" * len(columns) + "|")


def run_job(description, out, threads, quality):
    database = out / f"{description.stem}-{threads}.h5"
    shutil.rmtree(f"{database}.weft", ignore_errors=True)
    made = subprocess.run([WEFT, "run", description, "-o", database, "--quality", quality,
                           "--threads", str(threads), "--json"], check=True, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout
    return json.loads(made)


def inspect(database):
    return json.loads(subprocess.run([WEFT, "inspect", database, "--json"], check=True, text=True,
                                     stdout=subprocess.PIPE).stdout)


def same_content(one, other):
    if one != other:
        raise SystemExit(f"contents differ: {one} and {other}")


def cores(arguments):
    print_head(["fabric", "one thread", "two", "half of one is", "CPU, one / two", "idle threads"])
    for description in arguments.fabrics:
        one, two = (run_job(description, arguments.out, threads, arguments.quality)
                    for threads in (1, 2))
        same_content(one["content_digest"], two["content_digest"])
        print_row([one["fabric"], f"{one['seconds']:.1f} s", f"{two['seconds']:.1f} s",
                   f"{50 * one['seconds'] / two['seconds']:.0f} %",
                   f"{one['cpu_seconds']:.1f} / {two['cpu_seconds']:.1f} s",
                   f"{two['idle_thread_seconds']:.1f} s"])


def cpu_seconds(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


# The coordinator's threads that plan, lease, journal and answer, and gRPC's that take the workers'
# calls and carry all bytes of all calls: more than scheduling alone.
SCHEDULING = ("weft-plan", "weft-dispatch", "weft-journal", "weft-answer", "nexting_thread",
              "event_engine")


def cpu_of_threads(pid):
    """CPU seconds of the threads that there are now, by name."""
    seconds = collections.Counter()
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        beginning, end = (task / "stat").read_text().rsplit(")", 1)
        fields = end.split()
        name = beginning.split("(", 1)[1]
        seconds[name] += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return seconds


class Cluster:
    """`weft up` with workers of one thread each, on a state folder of its own."""

    def __init__(self, state, workers, on_cores):
        shutil.rmtree(state, ignore_errors=True)
        self.program = subprocess.Popen(
            [WEFT, "up", "--workers", str(workers), "--threads", "1", "--state", state,
             "--listen", "127.0.0.1:0", "--json"], text=True, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, preexec_fn=lambda: os.sched_setaffinity(0, on_cores))
        text = ""
        while True:  # one JSON value, over as many lines as it takes
            line = self.program.stdout.readline()
            if not line:
                raise SystemExit("the cluster did not start")
            text += line
            try:
                self.about = json.loads(text)
                return
            except json.JSONDecodeError:
                continue

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.program.terminate()
        self.program.wait()


def cluster_job(description, out, quality, workers, core_count):
    """The job by a cluster and the one who submits it, together on so many cores."""
    on_cores = sorted(os.sched_getaffinity(0))[:core_count]
    with Cluster(out / "state", workers, on_cores) as cluster:
        pid = cluster.about["pid"]
        address = cluster.about["coordinator"]
        database = out / f"{description.stem}-workers.h5"
        database.unlink(missing_ok=True)
        before = cpu_seconds(pid)
        since = time.monotonic()
        subprocess.run([WEFT, "submit", description, "--quality", quality, "--wait", "-o", database,
                        "--coordinator", address], check=True, stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL,
                       preexec_fn=lambda: os.sched_setaffinity(0, on_cores))
        seconds = time.monotonic() - since
        threads = cpu_of_threads(pid)
        return (seconds, cpu_seconds(pid) - before,
                sum(cpu_seconds(worker["pid"]) for worker in cluster.about["workers"]),
                inspect(database)["content_digest"], sum(threads[name] for name in SCHEDULING))


def workers(arguments):
    print_head(["fabric", "one worker, all on one core", "one worker, two cores", "two workers",
                "over half of one core", "over half of one worker",
                "CPU of the coordinator, of the workers (two)", "scheduling at most"])
    for description in arguments.fabrics:
        alone, one, two = (cluster_job(description, arguments.out, arguments.quality, *size)
                           for size in ((1, 1), (1, 2), (2, 2)))
        same_content(alone[3], two[3])
        same_content(one[3], two[3])
        print_row([description.stem, f"{alone[0]:.1f} s", f"{one[0]:.1f} s", f"{two[0]:.1f} s",
                   f"{100 * (2 * two[0] / alone[0] - 1):+.1f} %",
                   f"{100 * (2 * two[0] / one[0] - 1):+.1f} %", f"{two[1]:.2f} s, {two[2]:.1f} s",
                   f"{100 * two[4] / (two[1] + two[2]):.2f} %"])


def resized(text, repeats):
    """The description with so many repeats each way, few paths and as few cells."""
    text = re.sub(r"repeats_x: \d+", f"repeats_x: {repeats[0]}", text)
    text = re.sub(r"repeats_y: \d+", f"repeats_y: {repeats[1]}", text)
    return re.sub(r"cell_length_mfp: [\d.]+", "cell_length_mfp: 20 paths_per_cell: 256", text)


def sizes(arguments):
    print_head(["fabric", "repeats", "segments", "geometry, CPU s", "bits", "basis", "coefficients",
                "bits and coefficients, µs of CPU a segment", "merge", "wall", "memory, GiB"])
    description = arguments.fabrics[0]
    for repeats in ((1, 2), (3, 3), (6, 6), (9, 9), (13, 12)):
        changed = arguments.out / f"{description.stem}-{repeats[0]}x{repeats[1]}.textproto"
        changed.write_text(resized(description.read_text(), repeats))
        made = run_job(changed, arguments.out, 2, "paper")
        segments = inspect(made["output"])["segments"]
        cpu = {stage["name"]: stage["cpu_seconds"] for stage in made["stages"]}
        each_us = 1e6 * (cpu["visibility"] + cpu["coefficients"]) / segments
        print_row([made["fabric"], f"{repeats[0]} x {repeats[1]}", f"{segments:,}",
                   *(f"{cpu[name]:.1f}" for name in ("geometry", "visibility", "basis",
                                                     "coefficients")),
                   f"{each_us:.0f}", f"{made['merge_seconds']:.1f}", f"{made['seconds']:.1f} s",
                   f"{made['peak_memory_bytes'] / 2**30:.2f}"])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["cores", "workers", "sizes"])
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("fabrics", nargs="+", type=pathlib.Path)
    parser.add_argument("--quality", default="preview", choices=["preview", "paper", "best"])
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    {"cores": cores, "workers": workers, "sizes": sizes}[arguments.what](arguments)


if __name__ == "__main__":
    sys.exit(main())
