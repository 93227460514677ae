"""The messages and services of proto/weft/v1, made when this module is imported.

They come from `weft.protoset` (a FileDescriptorSet that the build writes beside this file or into
the folder that WEFT_PROTOSET names), else from the .proto files of the source tree by `protoc`.
`schema.Job`, `schema.Scene` and so on are the message classes; `schema.JOB_STATE_SUCCEEDED` and so on
the values of enumerations.
"""

import os
import pathlib
import subprocess
import tempfile

from google.protobuf import (descriptor_pb2, descriptor_pool, json_format, message_factory,
                             text_format)

_HERE = pathlib.Path(__file__).resolve().parent


def _compiled(root):
    files = sorted(str(path.relative_to(root)) for path in root.glob("proto/weft/v1/*.proto"))
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "weft.protoset")
        try:
            subprocess.run(
                ["protoc", "-I", str(root), "--include_imports", f"--descriptor_set_out={out}", *files],
                check=True, cwd=root, stderr=subprocess.PIPE, text=True)
        except FileNotFoundError:
            raise ImportError(
                "weft.protoset is not beside the module and there is no protoc; build weft, or "
                "install protobuf-compiler") from None
        except subprocess.CalledProcessError as error:
            raise ImportError(f"protoc cannot read {root}/proto/weft/v1: {error.stderr}") from None
        return pathlib.Path(out).read_bytes()


def _protoset():
    named = os.environ.get("WEFT_PROTOSET")
    for path in [pathlib.Path(named)] if named else [_HERE / "weft.protoset"]:
        if path.is_file():
            return path.read_bytes()
        if named:
            raise ImportError(f"WEFT_PROTOSET names {named}, which is no file")
    root = _HERE.parent.parent
    if not (root / "proto" / "weft" / "v1").is_dir():
        raise ImportError(f"{_HERE / 'weft.protoset'} is missing; install the module again")
    return _compiled(root)


def _load():
    files = descriptor_pb2.FileDescriptorSet.FromString(_protoset())
    # A pool of its own: another module may bring the same names.
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    factory = message_factory.MessageFactory(pool)
    found, services, enumerations = {}, {}, {}
    for file in files.file:
        if file.package != "weft.v1":
            continue
        descriptor = pool.FindFileByName(file.name)
        for name, message in descriptor.message_types_by_name.items():
            found[name] = factory.GetPrototype(message)
        for enumeration in descriptor.enum_types_by_name.values():
            found.update({value.name: value.number for value in enumeration.values})
            enumerations[enumeration.name] = enumeration
        services.update(descriptor.services_by_name)
    return found, services, enumerations


_FOUND, _SERVICES, _ENUMERATIONS = _load()
globals().update(_FOUND)


def word(enumeration, number):
    """A value of an enumeration as the command line writes it: word('JobState', 4) is 'succeeded'."""
    name = _ENUMERATIONS[enumeration].values_by_number[number].name
    prefix = "".join("_" + c if c.isupper() else c.upper() for c in enumeration).lstrip("_") + "_"
    return name.removeprefix(prefix).lower()


def stub(channel, service):
    """The calls of a service as functions: stub(channel, 'JobService').Submit(request)."""
    file = _SERVICES[service]
    # A descriptor does not say what streams: its proto does.
    described = descriptor_pb2.ServiceDescriptorProto()
    file.CopyToProto(described)
    calls = {}
    for method in described.method:
        kind = ("stream" if method.client_streaming else "unary") + "_" + (
            "stream" if method.server_streaming else "unary")
        calls[method.name] = getattr(channel, kind)(
            f"/weft.v1.{service}/{method.name}",
            request_serializer=lambda message: message.SerializeToString(),
            response_deserializer=_FOUND[method.output_type.rsplit(".", 1)[1]].FromString)
    return type(service, (), {name: staticmethod(call) for name, call in calls.items()})


def parse_json(text, message):
    """Fills a message from JSON as the command line writes it."""
    return json_format.Parse(text, message)


def parse_text(text, message, name="text"):
    """Fills a message from protobuf text; mistakes name the line and column."""
    from . import errors
    try:
        return text_format.Parse(text, message)
    except text_format.ParseError as error:
        raise errors.InvalidArgument(f"{name}:{error}") from None
