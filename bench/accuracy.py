#!/usr/bin/env python3
"""How far the precomputed renderer is from path tracing, on flat swatches.

For each fabric, light and view: the mean colour of an endless flat swatch over a black sheet, lights
cut at the horizon, by `weft render --integrator precomputed` and by `--integrator path --local`.
Prints one Markdown table: relative error of the mean colour in per cent (the mean over the colour
channels of |precomputed - path| over the mean of path), with the reference's standard error beside.

    bench/accuracy.py OUT_DIR FABRIC.h5 [FABRIC.h5 ...] [--size N] [--spp N] [--terms] [--views v,...]

Every rendering is kept as JSON in OUT_DIR and not made again: an interrupted run goes on.
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
WEFT = ROOT / "build" / "bin" / "weft"
SHARPNESS = [10, 50, 150, 400, 1000]
VIEWS = {"normal": (0.0, 0.0), "oblique": (45.0, 200.0)}  # polar angle, azimuth in degrees
LIGHT = (40.0, 60.0)


def direction(polar_deg, azimuth_deg):
    polar, azimuth = math.radians(polar_deg), math.radians(azimuth_deg)
    return (math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth),
            math.cos(polar))


def vector(values):
    return "{ x: %.9g y: %.9g z: %.9g }" % tuple(values)


def scene_text(tile_mm, view, sharpness, size, spp):
    towards = vector(direction(*LIGHT))
    light = (f"directional {{ towards {towards} }}" if sharpness is None
             else f"sg {{ towards {towards} sharpness: {sharpness} }}")
    eye = direction(*view)
    # The picture spans two tiles, so that its mean is the cloth's.
    height = 2 * tile_mm[1]
    width = size * 2 * tile_mm[0] / height
    position = vector([100 * c for c in eye])
    return (f"camera {{ position {position} look_at {{ }} up {{ y: 1 }} "
            f"orthographic {{ height_mm: {height * max(0.2, eye[2]):.9g} }} }}\n"
            f"lights {{ {light} }}\n"
            "cloths { flat { endless: true } black_underlay: true }\n"
            f"picture {{ width: {max(8, round(width))} height: {size} samples_per_pixel: {spp} }}\n"
            "cut_lights_at_horizon: true\n")


def render(out, fabric, scene, key, flags):
    kept = out / f"{key}.json"
    if not kept.exists():
        scene_file = out / f"{key}.textproto"
        scene_file.write_text(scene)
        done = subprocess.run(
            [WEFT, "render", fabric, "--scene", scene_file, "-o", out / f"{key}.exr", "--json",
             *flags], stdout=subprocess.PIPE, check=True, text=True)
        kept.write_text(done.stdout)
    return json.loads(kept.read_text())


def relative_error(value, reference, reference_error):
    mean = sum(reference) / 3
    error = sum(abs(a - b) for a, b in zip(value, reference)) / 3 / mean
    signed = (sum(value) - sum(reference)) / 3 / mean
    noise = math.sqrt(sum(e * e for e in reference_error)) / 3 / mean
    return 100 * error, 100 * signed, 100 * noise


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("fabrics", nargs="+", type=pathlib.Path)
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--terms", action="store_true",
                        help="also single and multiple scattering apart")
    parser.add_argument("--views", default="normal,oblique")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)

    terms = {"all": []}
    if arguments.terms:
        terms.update(single=["--single-only"], multiple=["--multiple-only"])
    print("| fabric | view | terms | " +
          " | ".join(["directional"] + [f"SG {s}" for s in SHARPNESS]) + " |")
    print("|---" * (4 + len(SHARPNESS)) + "|")
    for fabric in arguments.fabrics:
        about = json.loads(subprocess.run([WEFT, "inspect", fabric, "--json"], check=True,
                                          stdout=subprocess.PIPE, text=True).stdout)
        for view in arguments.views.split(","):
            for term, flags in terms.items():
                cells = []
                for sharpness in [None] + SHARPNESS:
                    scene = scene_text(about["size_mm"], VIEWS[view], sharpness, arguments.size,
                                       arguments.spp)
                    key = f"{fabric.stem}-{view}-{term}-{sharpness or 'directional'}"
                    ours = render(arguments.out, fabric, scene, key + "-precomputed",
                                  ["--integrator", "precomputed", *flags])
                    theirs = render(arguments.out, fabric, scene, key + "-path",
                                    ["--integrator", "path", "--local", *flags])
                    error, signed, noise = relative_error(
                        ours["cloth_mean"], theirs["cloth_mean"],
                        theirs["cloth_standard_error"])
                    cells.append(f"{error:.1f} ({signed:+.1f}) ± {noise:.1f}")
                print(f"| {fabric.stem} | {view} | {term} | " + " | ".join(cells) + " |",
                      flush=True)


if __name__ == "__main__":
    sys.exit(main())
