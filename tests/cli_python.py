"""The module weft against a running cluster: cli_python.py COORDINATOR NODE DESCRIPTION FOLDER.

Prints what it found as one JSON value, for the test that started it and set PYTHONPATH.
"""

import json
import os
import pathlib
import sys

import numpy
import weft


def words_of(error_type, call):
    """The message of an exception that must come."""
    try:
        call()
    except error_type as error:
        return {"text": str(error), "code": error.code, "exit_code": error.exit_code}
    raise AssertionError(f"no {error_type.__name__} came")


def run(coordinator, node, description, folder):
    found = {}
    with weft.Coordinator(coordinator) as cluster:
        found["unknown_job"] = words_of(weft.NotFound, lambda: cluster.job("j123456789abc"))
        broken = os.path.join(folder, "broken.textproto")
        pathlib.Path(broken).write_text('name: "broken"\nyarnz { }\n')
        found["broken"] = words_of(weft.WeftError, lambda: cluster.submit(broken))

        shares = []
        job = cluster.submit(description, comment="from Python")
        job = cluster.wait(job.id, report=lambda seen: shares.append(weft.fraction_done(seen)))
        found["last_share"] = shares[-1]
        found["reference"] = weft.reference_of(job.version)
        found["comment"] = cluster.version(found["reference"]).comment
        found["unknown_fabric"] = words_of(weft.NotFound, lambda: cluster.version("nobody"))
        found["fabrics"] = [fabric.name for fabric in cluster.fabrics()]
        found["jobs"] = len(cluster.jobs())
        found["workers"] = len(cluster.workers())

        # The canonical description of a published version makes the same version again.
        path = os.path.join(folder, "python.h5")
        with cluster.fetch(found["reference"], path) as database:
            again = cluster.wait(cluster.submit(dict(database.description)).id)
            found["again_cached"] = all(
                stage.shards == stage.shards_cached for stage in again.stages)
            found["transfer_shape"] = list(database["iirtf/transfer"].shape)
            found["grid_cells"] = int((database.cell_grid() >= 0).sum())
            found["cells"] = len(database["cells/coordinates"])
            starts, ends = database.segment_ends()
            found["segments"] = len(starts)
            found["segment_share"] = len(database["visibility/open_share"])
            found["longest_mm"] = float(numpy.linalg.norm(ends - starts, axis=1).max())
            found["strands"] = len(database.strands)
            share = database["visibility/open_share"].astype(float)
            segment = int(numpy.argmax((share > 0.2) & (share < 0.8)))
            seen = database.visibility(segment)
            sine = numpy.sin(database["visibility/theta"])[:, None]
            found["open_share"] = float(share[segment])
            found["open_share_of_map"] = float((seen * sine).sum() / (sine.sum() * seen.shape[1]))

    with weft.RenderNode(node) as painter:
        found["device"] = painter.about().device
        reported = []
        picture = painter.render(found["reference"], size=(48, 32), samples=2,
                                 report=reported.append)
        found["shape"] = list(picture.colour.shape)
        found["planes"] = sorted(picture.planes)
        numpy.save(os.path.join(folder, "colour.npy"), picture.colour)
        found["mean"] = [float(x) for x in picture.colour.mean(axis=(0, 1))]
        found["node_unknown"] = words_of(weft.NotFound, lambda: painter.render("nobody@7"))
        found["node_missing_file"] = words_of(
            weft.NotFound, lambda: painter.render(found["reference"], scene_with_mesh(folder)))

    away = "127.0.0.1:1"
    found["away"] = words_of(weft.Unavailable, lambda: weft.Coordinator(away).jobs())
    found["bad_address"] = words_of(weft.InvalidArgument, lambda: weft.Coordinator("nowhere"))
    found["far"] = words_of(weft.PermissionDenied, lambda: weft.Coordinator("hub.example:7411"))
    found["no_tls_folder"] = words_of(
        weft.NotFound, lambda: weft.Coordinator(coordinator, tls_folder=os.path.join(folder, "no")))
    return found


def scene_with_mesh(folder):
    path = os.path.join(folder, "mesh.textproto")
    pathlib.Path(path).write_text('cloths { shell { obj_file: "absent.obj" } }\n')
    return path


print(json.dumps(run(*sys.argv[1:])))
