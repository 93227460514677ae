"""What Blender makes of files that weft wrote: blender -b --python open_elsewhere.py -- OUT MESH FILE...

Opens OBJ and glTF files, all in one start, and writes what it found as JSON to OUT. Writes a mesh of
its own as binary glTF to MESH.
"""

import json
import os
import sys

import bpy
import numpy

# Debian 12's glTF importer uses a name that its numpy no longer has.
numpy.bool = bool


def opened(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.endswith(".obj"):
        bpy.ops.wm.obj_import(filepath=path, forward_axis="Y", up_axis="Z")
    else:
        bpy.ops.import_scene.gltf(filepath=path)
    meshes = [item for item in bpy.context.scene.objects if item.type == "MESH"]
    curves = [item for item in bpy.context.scene.objects if item.type == "CURVE"]
    found = {
        "objects": len(bpy.context.scene.objects),
        "points": sum(len(item.data.vertices) for item in meshes)
        + sum(len(spline.points) for item in curves for spline in item.data.splines),
        "edges": sum(len(item.data.edges) for item in meshes),
        "faces": sum(len(item.data.polygons) for item in meshes),
        "splines": sum(len(item.data.splines) for item in curves),
    }
    for material in bpy.data.materials:
        if not material.use_nodes:
            continue
        images = [node.image for node in material.node_tree.nodes if node.type == "TEX_IMAGE"]
        found["images"] = sorted(os.path.basename(image.filepath) for image in images)
        found["image_sizes"] = sorted(list(image.size) for image in images)
        found["has_data"] = all(image.has_data or len(image.pixels) > 0 for image in images)
        found["nodes"] = sorted({node.type for node in material.node_tree.nodes})
        found["blend"] = material.blend_method
    if meshes:
        found["size"] = list(meshes[0].dimensions)
        layers = meshes[0].data.uv_layers
        if layers:
            found["uv"] = [[min(p.uv[k] for p in layers[0].data), max(p.uv[k] for p in layers[0].data)]
                           for k in (0, 1)]
    return found


def write_mesh(path):
    """A grid of 4 by 3 squares, 200 mm by 100 mm, half a metre above the ground, its node scaled."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=3, size=0.2, location=(0, 0, 0.5))
    bpy.context.object.scale = (1, 0.5, 1)
    bpy.ops.export_scene.gltf(filepath=path, export_format="GLB")


found_in, mesh, *files = sys.argv[sys.argv.index("--") + 1:]
with open(found_in, "w") as out:
    json.dump({os.path.basename(path): opened(path) for path in files}, out)
write_mesh(mesh)
