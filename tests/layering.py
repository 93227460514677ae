#!/usr/bin/env python3
"""Fails when a folder includes what it must not: the table of docs/architecture.md, checked.

Also keeps third-party libraries behind their one file pair. Usage: layering.py SOURCE_DIR
"""

import pathlib
import re
import sys

MAY_INCLUDE = {
    "proto": {"core"},  # the envelope throws core::Error
    "core": set(),
    "shading": set(),
    "fabric": {"core", "proto"},
    "transport": {"core", "shading", "fabric"},
    "storage": {"core", "shading"},
    "security": {"core", "proto"},
    "client": {"core", "proto", "security", "storage"},
    "coordinator": {"core", "fabric", "proto", "security", "storage", "shading"},
    "worker": {"core", "fabric", "security", "shading", "transport", "proto"},
    "render": {"core", "shading", "fabric", "transport", "storage", "proto", "security", "client"},
}
MAY_INCLUDE["cli"] = set(MAY_INCLUDE) | {"cli"}

# Folders inside a folder, each of which may include those before it.
ORDER = {"coordinator": ["queue", "journal", "versions", "scheduler", "services", "web"]}

# Third-party header -> the files that alone include it.
BEHIND = {
    r"hdf5\.h|H5.*\.h": {"storage/h5.cpp", "storage/h5_chunk_reader.cpp", "storage/h5_chunks.cpp",
                           "storage/h5_reader.cpp", "storage/h5_types.cpp"},
    r"libdeflate\.h": {"storage/h5_filters.cpp"},
    r"embree3/.*": {"transport/embree_scene.cpp", "render/triangle_scene.cpp"},
    r"(OpenEXR/)?Imf.*": {"render/image.cpp", "render/files/exr_parser.cpp"},
    r"png\.h": {"render/png.cpp", "render/files/png_parser.cpp", "coordinator/web/png.cpp"},
    r"vulkan/.*": {"render/gpu/vulkan.h"},
    r"sqlite3\.h": {"coordinator/journal/sqlite.cpp"},
    r"tiny_obj_loader\.h": {"render/files/obj_parser.cpp"},
    r"tiny_gltf\.h": {"render/files/gltf_parser.cpp"},
    r"openssl/.*": {"core/digest.cpp", "security/x509.cpp", "security/tls_probe.cpp",
                     "security/web_gate.cpp"},
    r"httplib\.h": {"coordinator/web/http_server.cpp"},
    r"prometheus/.*": {"coordinator/web/metrics.cpp"},
    r"Random123/.*": {"core/random.h"},
    r"toml\+\+/.*": {"core/settings_file.cpp"},
}

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


def mistakes_of(root: pathlib.Path):
    for folder, allowed in MAY_INCLUDE.items():
        for path in sorted((root / folder).rglob("*")):
            if path.suffix not in {".h", ".cpp", ".comp"}:
                continue
            name = path.relative_to(root).as_posix()
            for number, line in enumerate(path.read_text().splitlines(), 1):
                match = INCLUDE.match(line)
                if not match:
                    continue
                quoted, target = match.group(1) == '"', match.group(2)
                first = target.split("/")[0]
                where = f"{name}:{number}"
                if quoted and "/" not in target:
                    yield f"{where}: '{target}' is not a full path from the root"
                if first in MAY_INCLUDE and first != folder and first not in allowed:
                    yield f"{where}: {folder} may not include {first} ({target})"
                inner, including = ORDER.get(folder, []), name.split("/")[1]
                included = target.split("/")[1] if first == folder else ""
                if including in inner and included in inner:
                    if inner.index(included) > inner.index(including):
                        yield f"{where}: {folder}/{including} may not include {included} ({target})"
                for pattern, owners in BEHIND.items():
                    if re.fullmatch(pattern, target) and name not in owners:
                        yield f"{where}: {target} belongs behind {', '.join(sorted(owners))}"


def main():
    root = pathlib.Path(sys.argv[1])
    mistakes = list(mistakes_of(root))
    for mistake in mistakes:
        print(mistake)
    if not any((root / folder).rglob("*.cpp") for folder in MAY_INCLUDE):
        print(f"no sources under {root}")
        return 1
    return 1 if mistakes else 0


sys.exit(main())
