"""One fibre segment under a light that goes all around it: the paper's figures 10 and 11."""

import json
import subprocess

from evaluation.renderer import BIN, say

# Figure 10 (single scattering, the low-rank scheme of Tsai and Shih 2006) and figure 11 (all
# scattering, standard PRT of Sloan et al. 2002).
FIGURES = {"10": {"sharpness": 50}, "11": {"sharpness": 400}}


def run(bench, fabrics, deadline, out):
    out.mkdir(parents=True, exist_ok=True)
    paths = bench.settings["response_paths"]
    for fabric in fabrics:
        for figure, light in FIGURES.items():
            if deadline.over():
                say("responses: time is up")
                return
            inputs = {"part": "responses", "fabric": fabric.name, "digest": fabric.digest,
                      "figure": figure, "paths": paths, **light}
            if bench.record.find(inputs) is not None:
                continue
            made = subprocess.run(
                [BIN / "bench_segment_response", fabric.path, "--figure", figure, "--sharpness",
                 str(light["sharpness"]), "--paths", str(paths), "-o",
                 out / f"{fabric.name}-figure-{figure}.png"],
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
            if made.returncode != 0:
                bench.failed += 1
                say(f"responses: {fabric.name}: {made.stderr.strip()}")
                continue
            bench.record.keep(inputs, json.loads(made.stdout))
            say(f"responses: {fabric.name}, figure {figure}")
