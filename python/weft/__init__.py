"""Weft from Python: submit fabrics, watch jobs, fetch databases, draw pictures, as numpy arrays.

    import weft
    with weft.Coordinator() as cluster:
        job = cluster.wait(cluster.submit("examples/tiny.textproto", quality="preview").id)
        tiny = cluster.fetch("tiny@latest", "tiny.h5")
    print(tiny["iirtf/transfer"].shape)
    picture = weft.RenderNode().render("tiny@latest", size=(256, 256))

docs/python.md tells more. Every mistake is raised as a weft.WeftError with the words of the command
line.
"""

from .coordinator import Coordinator, expand, fraction_done, has_ended, reference_of
from .database import Database
from .errors import (AlreadyExists, Cancelled, DataLoss, FailedPrecondition, InvalidArgument,
                     JobFailed, NotFound, PermissionDenied, ResourceExhausted, Unavailable, WeftError)
from .node import Picture, RenderNode, load_scene, srgb

__all__ = [
    "AlreadyExists", "Cancelled", "Coordinator", "DataLoss", "Database", "FailedPrecondition",
    "InvalidArgument", "JobFailed", "NotFound", "PermissionDenied", "Picture", "RenderNode",
    "ResourceExhausted", "Unavailable", "WeftError", "expand", "fraction_done", "has_ended",
    "load_scene", "reference_of", "srgb",
]
