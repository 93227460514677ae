"""A render node: scenes in, pictures as numpy arrays out."""

import hashlib
import os
import pathlib
import re
import uuid

import grpc
import numpy

from . import errors, schema
from .channel import DEFAULT_NODE, Connection

_CHUNK_BYTES = 1 << 20
_LONGEST_SECONDS = 14 * 24 * 3600
_THREE_FLOATS = ("colour", "standard_error", "single", "multiple", "tangent", "normal")
_WHOLE_NUMBERS = ("segment", "cloth")


def load_scene(path):
    """A scene from a .textproto or .json file; files that it names stay relative to it."""
    text = pathlib.Path(path).read_text()
    if str(path).endswith(".json"):
        return schema.parse_json(text, schema.Scene())
    return schema.parse_text(text, schema.Scene(), str(path))


class Picture:
    """What a node drew: `planes` by name ('colour', 'standard_error', 'segment', ...).

    Each plane is an array [height, width, 3], or [height, width], the top row first; `colour` is
    linear RGB. `header` is the node's PictureHeader, `frame` the number of the animation's frame.
    """

    def __init__(self, header, frame, data):
        self.header = header
        self.frame = frame
        self.planes = {}
        shape, at = (header.height, header.width), 0
        for number in header.planes:
            name = schema.word("PicturePlane", number)
            channels = 3 if name in _THREE_FLOATS else 1
            kind = "<u4" if name in _WHOLE_NUMBERS else "<f4"
            count = shape[0] * shape[1] * channels
            plane = numpy.frombuffer(data, kind, count, at)
            at += plane.nbytes
            self.planes[name] = plane.reshape(shape + ((3,) if channels == 3 else ()))

    @property
    def colour(self):
        return self.planes["colour"]


def srgb(colour, exposure_stops=0.0):
    """Linear RGB as a screen shows it: uint8, clipped at white."""
    linear = numpy.clip(numpy.asarray(colour, dtype=float) * 2.0 ** exposure_stops, 0, 1)
    encoded = numpy.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return numpy.round(255 * encoded).astype(numpy.uint8)


def default_scene():
    """What `weft render` draws without a scene: endless flat cloth under a key light and a soft one."""
    scene = schema.Scene(cut_lights_at_horizon=True)
    for towards, sharpness, irradiance in (((-0.55, 0.35, 0.75), 60, 3.0), ((0.6, -0.5, 0.7), 5, 0.7)):
        light = scene.lights.add().sg
        light.towards.x, light.towards.y, light.towards.z = towards
        light.sharpness = sharpness
        light.irradiance.r = light.irradiance.g = light.irradiance.b = irradiance
    cloth = scene.cloths.add(black_underlay=True)
    cloth.flat.endless = True
    return scene


def _complete(scene, fabric):
    """A copy of the scene that lacks nothing a node needs: render::complete_scene."""
    wanted = schema.Scene()
    wanted.CopyFrom(scene)
    otherwise = default_scene()
    if not wanted.lights:
        wanted.lights.MergeFrom(otherwise.lights)
    if not wanted.cloths:
        wanted.cloths.MergeFrom(otherwise.cloths)
    for cloth in wanted.cloths:
        if cloth.HasField("pattern"):
            names = [name or fabric for name in cloth.pattern.fabrics]
            del cloth.pattern.fabrics[:]
            cloth.pattern.fabrics.extend(names)
        elif not cloth.fabric:
            cloth.fabric = fabric
    picture, integration = wanted.picture, wanted.integration
    integration.integrator = integration.integrator or schema.INTEGRATOR_PRECOMPUTED
    integration.seed = integration.seed or 1
    integration.scattering = integration.scattering or schema.SCATTERING_ALL
    picture.width = picture.width or 512
    picture.height = picture.height or 512
    closed_form = integration.integrator == schema.INTEGRATOR_PRECOMPUTED
    picture.samples_per_pixel = picture.samples_per_pixel or (8 if closed_form else 128)
    return wanted


def _frame_numbers(animation):
    return range(animation.first_frame, animation.first_frame + animation.frames)


def _files_of(scene):
    """Names of the files that a scene refers to, each once."""
    names = {light.environment.exr_file for light in scene.lights}
    names |= {key.value.environment.exr_file for key in scene.animation.lights}
    names |= {cloth.pattern.png_file for cloth in scene.cloths}
    for cloth in scene.cloths:
        name = cloth.shell.obj_file
        if scene.HasField("animation") and re.search(r"%0?[0-9]*d", name):
            names |= {name % frame for frame in _frame_numbers(scene.animation)}
        else:
            names.add(name)
    return sorted(names - {""})


class RenderNode(Connection):
    """A connection to the render node at `address` (default: this machine's)."""

    def __init__(self, address=DEFAULT_NODE, tls_folder=None, insecure=False):
        super().__init__(address, tls_folder, insecure)
        self._service = schema.stub(self._channel, "RenderService")

    def about(self):
        """What the node is and does now (GetNodeResponse)."""
        try:
            return self._service.GetNode(schema.GetNodeRequest(), timeout=20)
        except grpc.RpcError as error:
            raise self._explained(error) from None

    def render(self, fabric, scene=None, folder=".", size=None, samples=None, report=None):
        """Draws one picture of a published fabric (silk, silk@3) and returns it.

        `scene`: a Scene, or a path to one; None draws a flat swatch. Cloths that name no fabric get
        this one. Files that the scene names are read from `folder`, or from beside its path. `size`
        is (width, height). `report` is called with the share that is drawn.
        """
        last = None
        for last in self.frames(fabric, scene, folder, size, samples, report):
            pass
        return last

    def frames(self, fabric, scene=None, folder=".", size=None, samples=None, report=None):
        """Yields a Picture for every frame of a scene's animation; one when it has none."""
        order, files = self._order(fabric, scene, folder, size, samples)
        started = header = data = None
        try:
            for event in self._service.Render(_parts(order, files), timeout=_LONGEST_SECONDS):
                kind = event.WhichOneof("event")
                if kind == "frame":
                    started = event.frame
                elif kind == "progress" and report is not None:
                    report(event.progress.share)
                elif kind == "picture":
                    header, data = event.picture, bytearray()
                elif kind == "chunk":
                    data += event.chunk
                    if header is not None and len(data) >= _bytes_of(header):
                        yield Picture(header, started.frame if started else 0, bytes(data))
                        header = None
        except grpc.RpcError as error:
            raise self._explained(error) from None

    def _order(self, fabric, scene, folder, size, samples):
        if isinstance(scene, (str, os.PathLike)):
            folder, scene = os.path.dirname(scene) or ".", load_scene(scene)
        wanted = _complete(default_scene() if scene is None else scene, fabric)
        if size is not None:
            wanted.picture.width, wanted.picture.height = size
        if samples is not None:
            wanted.picture.samples_per_pixel = samples
        order = schema.RenderOrder(request_id=uuid.uuid4().hex, scene=wanted)
        files = []
        for name in _files_of(wanted):
            try:
                files.append(pathlib.Path(folder, name).read_bytes())
            except OSError as error:
                raise errors.NotFound(f"cannot read {name}: {error.strerror}") from None
            order.attachments.add(name=name, size_bytes=len(files[-1]),
                                  digest=hashlib.sha256(files[-1]).digest())
        return order, files

    def _explained(self, error):
        address, details = self._endpoint.address, error.details()
        if error.code() != grpc.StatusCode.UNAVAILABLE:
            return errors.from_status(error.code(), details)
        problem = self._endpoint.tls_problem()
        if problem:
            return errors.PermissionDenied(problem)
        return errors.Unavailable(
            f"no render node answers at {address} ({details}); start one with 'weft-render', or name "
            "another with --node")


def _parts(order, files):
    yield schema.RenderRequest(order=order)
    for data in files:
        for at in range(0, len(data), _CHUNK_BYTES):
            yield schema.RenderRequest(chunk=data[at:at + _CHUNK_BYTES])


def _bytes_of(header):
    pixels = header.width * header.height
    names = [schema.word("PicturePlane", number)
             for number in header.planes]
    return sum(pixels * (12 if name in _THREE_FLOATS else 4) for name in names)
