#!/usr/bin/env python3
"""Path tracing of the same fibres by weft and by Blender's Cycles, samples per CPU second.

    bench/cycles.py FABRIC.textproto OUT_DIR [--quality Q] [--size N] [--depth D] [--threads N]
                    [--weft PROGRAM ...]

Wants Blender 3.4 (apt-get install blender). The same curves (weft export), the same orthographic
view of the middle of 3 x 3 tiles from above, one light from a direction over a black ground, paths
of the same greatest length. Not the same: Cycles scatters by its hair BSDF, not by the fabric's
materials, and meets a fibre's surface where weft scatters on its axis, so the pictures are only
alike. Times are processor time of all threads, the difference of two runs that differ in samples.
"""

import argparse
import json
import pathlib
import re
import resource
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
WEFT = ROOT / "build" / "bin" / "weft"
TILES = 3
LIGHT = (0.4, 0.3, 0.866)


def read_curves(path):
    """Polylines and radii in millimetres from `weft export --format pbrt`: straight cubic spans."""
    text = path.read_text()
    curves = []
    shape = re.compile(r'Shape "curve".*?"float width0" (\S+).*?\[\n(.*?)\]', re.S)
    for width, points in shape.findall(text):
        numbers = [float(n) for n in points.split()]
        corners = [tuple(numbers[i:i + 3]) for i in range(0, len(numbers), 9)]
        curves.append((float(width) / 2, corners))
    return curves


def bounds(curves):
    axes = list(zip(*(p for _, corners in curves for p in corners)))
    return [min(a) for a in axes], [max(a) for a in axes]


def scene_text(size_mm, arguments, samples):
    x, y, z = LIGHT
    return f"""# proto-message: weft.v1.Scene
camera {{ position {{ x: 0 y: 0 z: 50 }} look_at {{ x: 0 y: 0 z: 0 }}
  orthographic {{ height_mm: {size_mm[1] / TILES} }} }}
lights {{ directional {{ towards {{ x: {x} y: {y} z: {z} }} irradiance {{ r: 3 g: 3 b: 3 }} }} }}
cloths {{ flat {{ tiles_x: {TILES} tiles_y: {TILES} }} black_underlay: true }}
picture {{ width: {arguments.size} height: {arguments.size} samples_per_pixel: {samples} }}
integration {{ integrator: INTEGRATOR_PATH max_scatterings: {arguments.depth} }}
"""


def weft_seconds(weft, arguments, size_mm, samples):
    scene = arguments.out / f"weft-{samples}.scene.textproto"
    scene.write_text(scene_text(size_mm, arguments, samples))
    before = children_seconds()
    subprocess.run([weft, "render", arguments.fabric, "--scene", scene, "--device", "cpu",
                    "--threads", str(arguments.threads), "-o", arguments.out / "weft.exr",
                    "--png", arguments.out / "weft.png"],
                   check=True, stdout=subprocess.DEVNULL)
    return children_seconds() - before


def description_of(arguments):
    """The fabric at the quality that is asked for: `weft export` takes it as an option, `weft
    render` as the description says."""
    text = arguments.fabric.read_text()
    if arguments.quality:
        quality = f"quality: QUALITY_{arguments.quality.upper()}"
        text, places = re.subn(r"^precompute \{", "precompute { " + quality, text, flags=re.M)
        text += "" if places else f"\nprecompute {{ {quality} }}\n"
    description = arguments.out / arguments.fabric.name
    description.write_text(text)
    return description


def children_seconds():
    use = resource.getrusage(resource.RUSAGE_CHILDREN)
    return use.ru_utime + use.ru_stime


def cycles_seconds(arguments):
    """Processor seconds of the renders alone, by their samples."""
    order = json.dumps({"curves": str(arguments.out / "curves.pbrt"), "size": arguments.size,
                        "depth": arguments.depth, "threads": arguments.threads,
                        "samples": [arguments.few, arguments.many],
                        "picture": str(arguments.out / "cycles.png")})
    said = subprocess.run(["blender", "--background", "--factory-startup", "--python-exit-code",
                           "1", "--python", __file__, "--", order], check=True, text=True,
                          stdout=subprocess.PIPE).stdout
    return json.loads(re.search(r"^seconds (.*)$", said, re.M).group(1))


def compare(arguments):
    arguments.out.mkdir(parents=True, exist_ok=True)
    arguments.fabric = description_of(arguments)
    subprocess.run([WEFT, "export", arguments.fabric, "-o", arguments.out / "curves.pbrt",
                    "--tiles", f"{TILES}x{TILES}"], check=True, stdout=subprocess.DEVNULL)
    low, high = bounds(read_curves(arguments.out / "curves.pbrt"))
    size_mm = [b - a for a, b in zip(low, high)]
    samples = arguments.size ** 2 * (arguments.many - arguments.few)
    few, many = cycles_seconds(arguments)
    theirs = samples / (many - few)
    for weft in arguments.weft:
        few, many = [weft_seconds(weft, arguments, size_mm, n)
                     for n in (arguments.few, arguments.many)]
        ours = samples / (many - few)
        print(f"| {arguments.fabric.stem} | {arguments.depth} | {ours:,.0f} | {theirs:,.0f} | "
              f"{ours / theirs:.2f} |")


def curve_object(bpy, curves):
    data = bpy.data.curves.new("fibres", "CURVE")
    data.dimensions = "3D"
    for radius, corners in curves:
        spline = data.splines.new("POLY")
        spline.points.add(len(corners) - 1)
        spline.points.foreach_set("co", [c for p in corners for c in (*p, 1.0)])
        spline.points.foreach_set("radius", [radius] * len(corners))
    return bpy.data.objects.new("fibres", data)


def hair_object(bpy, fibres, material):
    """Cycles draws curves as hair when an object of hair curves evaluates to them."""
    nodes = bpy.data.node_groups.new("as hair", "GeometryNodeTree")
    nodes.outputs.new("NodeSocketGeometry", "Geometry")
    source = nodes.nodes.new("GeometryNodeObjectInfo")
    source.inputs["Object"].default_value = fibres
    painted = nodes.nodes.new("GeometryNodeSetMaterial")
    painted.inputs["Material"].default_value = material
    out = nodes.nodes.new("NodeGroupOutput")
    nodes.links.new(source.outputs["Geometry"], painted.inputs["Geometry"])
    nodes.links.new(painted.outputs["Geometry"], out.inputs["Geometry"])
    hair = bpy.data.objects.new("hair", bpy.data.hair_curves.new("hair"))
    hair.modifiers.new("as hair", "NODES").node_group = nodes
    return hair


def hair_material(bpy):
    material = bpy.data.materials.new("fibre")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    bsdf = tree.nodes.new("ShaderNodeBsdfHairPrincipled")
    bsdf.parametrization = "COLOR"
    bsdf.inputs["Color"].default_value = (0.7, 0.6, 0.5, 1)
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(bsdf.outputs["BSDF"], out.inputs["Surface"])
    return material


def draw_in_blender(order):
    import bpy  # Blender's own, there inside it alone
    import mathutils
    curves = read_curves(pathlib.Path(order["curves"]))
    low, high = bounds(curves)
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    scene = bpy.context.scene
    scene.world.use_nodes = False
    scene.world.color = (0, 0, 0)
    fibres = curve_object(bpy, curves)
    hair = hair_object(bpy, fibres, hair_material(bpy))
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type = "ORTHO"
    camera.data.ortho_scale = (high[1] - low[1]) / TILES
    camera.location = [(a + b) / 2 for a, b in zip(low[:2], high[:2])] + [50]
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 3
    sun.data.angle = 0
    sun.rotation_euler = mathutils.Vector(LIGHT).to_track_quat("Z", "Y").to_euler()
    fibres.hide_render = True
    for thing in (fibres, hair, camera, sun):
        scene.collection.objects.link(thing)
    scene.camera = camera
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = order["size"]
    render.resolution_percentage = 100
    render.threads_mode = "FIXED"
    render.threads = order["threads"]
    scene.cycles_curves.shape = "THICK"
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.pixel_filter_type = "BOX"
    for bounces in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces",
                    "transparent_max_bounces"):
        setattr(cycles, bounces, order["depth"])
    seconds = []
    for samples in order["samples"]:
        cycles.samples = samples
        render.filepath = order["picture"]
        before = time.process_time()
        bpy.ops.render.render(write_still=True)
        seconds.append(time.process_time() - before)
    print("seconds", json.dumps(seconds))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("fabric", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--quality", choices=["preview", "paper", "best"])
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--depth", type=int, default=16, help="scatterings of a path at most")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--weft", type=pathlib.Path, nargs="+", default=[WEFT],
                        help="programs to measure, of several builds a row each")
    parser.add_argument("--few", type=int, default=1, help="samples of the shorter run")
    parser.add_argument("--many", type=int, default=17, help="samples of the longer run")
    compare(parser.parse_args())


if "bpy" in sys.modules:
    draw_in_blender(json.loads(sys.argv[sys.argv.index("--") + 1]))
elif __name__ == "__main__":
    sys.exit(main())
