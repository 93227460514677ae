"""Makes hostile fabric databases: FROM FOLDER writes FOLDER/<name>.h5 for every way below.

Each is a copy of the database FROM to which one thing was done, sealed with a right digest, so that
nothing but the reader's own care stands between it and HDF5.
"""

import hashlib
import os
import pathlib
import shutil
import sys
import zlib

import h5py
import numpy as np

USER_BLOCK_BYTES = 512
BASIS = "visibility/ssdf/basis"
POINTS = "exemplar/points_mm"
WAYS = {}


def way(function):
    WAYS[function.__name__] = function
    return function


def seal(path):
    with open(path, "r+b") as file:
        file.seek(USER_BLOCK_BYTES)
        digest = hashlib.sha256(file.read()).hexdigest()
        text = f"weft fabric database\nschema 1\nbytes {os.path.getsize(path)}\nsha256 {digest}\n"
        file.seek(0)
        file.write(text.encode().ljust(USER_BLOCK_BYTES, b"\0"))


def replace(file, path, data, **options):
    del file[path]
    return file.create_dataset(path, data=data, **options)


def change(file, path, edit):
    """Writes a dataset anew after `edit` changed its values."""
    values = file[path][...]
    edit(values)
    replace(file, path, values, chunks=values.shape)


def deflated_zeros(size):
    packer, step = zlib.compressobj(9), bytes(1 << 20)
    return b"".join(packer.compress(step) for _ in range(size >> 20)) + packer.flush()


@way
def untouched(file):
    pass


@way
def missing_dataset(file):
    del file["cells/coordinates"]


@way
def missing_group(file):
    del file["visibility"]


@way
def soft_link(file):
    del file["cells/coordinates"]
    file["cells/coordinates"] = h5py.SoftLink("/exemplar/threads")


@way
def soft_link_cycle(file):
    del file["cells"]
    file["cells"] = h5py.SoftLink("/cells")


@way
def hard_link_cycle(file):
    file["cells/again"] = file["/"]


@way
def external_link(file):
    del file["cells/coordinates"]
    file["cells/coordinates"] = h5py.ExternalLink("/etc/passwd", "/x")


@way
def external_group(file):
    del file["cells"]
    file["cells"] = h5py.ExternalLink("other.h5", "/cells")


@way
def external_storage(file):
    basis = file[BASIS][...]
    replace(file, BASIS, None, shape=basis.shape, dtype="<f4",
            external=[("/etc/passwd", 0, basis.nbytes)])


@way
def virtual_dataset(file):
    shape = file[BASIS].shape
    del file[BASIS]
    layout = h5py.VirtualLayout(shape=shape, dtype="<f4")
    layout[...] = h5py.VirtualSource("/etc/passwd", "x", shape=shape)
    file.create_virtual_dataset(BASIS, layout)


@way
def compact_storage(file):
    data = file["cells/coordinates"][...]
    replace(file, "cells/coordinates", data)


@way
def filter_lzf(file):
    basis = file[BASIS][...]
    replace(file, BASIS, basis, chunks=basis.shape, compression="lzf")


@way
def filter_scale_offset(file):
    data = file["cells/coordinates"][...]
    replace(file, "cells/coordinates", data, chunks=data.shape, scaleoffset=0)


@way
def filter_of_a_plug_in(file):
    basis = file[BASIS][...]
    del file[BASIS]
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk(basis.shape)
    properties.set_filter(32015, h5py.h5z.FLAG_OPTIONAL, (3,))
    space = h5py.h5s.create_simple(basis.shape)
    dataset = h5py.h5d.create(file.id, BASIS.encode(), h5py.h5t.IEEE_F32LE, space, properties)
    dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, basis)


@way
def huge_shape(file):
    replace(file, POINTS, None, shape=(1 << 40, 3), dtype="<f4", chunks=(1 << 20, 3),
            compression="gzip")


@way
def shape_that_overflows(file):
    replace(file, POINTS, None, shape=(1 << 62, 3), dtype="<f4", chunks=(1 << 20, 3),
            compression="gzip")


@way
def missing_chunk(file):
    points = file[POINTS][...]
    made = replace(file, POINTS, None, shape=points.shape, dtype="<f4", chunks=(5, 3))
    made[5:] = points[5:]


@way
def huge_chunk(file):
    rows = 1 << 24
    made = replace(file, POINTS, None, shape=(rows, 3), dtype="<f4", chunks=(rows, 3),
                   compression="gzip")
    made.id.write_direct_chunk((0, 0), deflated_zeros(rows * 12))


@way
def deflate_bomb(file):
    rows = 1 << 20
    made = replace(file, POINTS, None, shape=(rows * 64, 3), dtype="<f4", chunks=(rows, 3),
                   compression="gzip")
    chunk = deflated_zeros(rows * 12)
    for i in range(64):
        made.id.write_direct_chunk((i * rows, 0), chunk)


@way
def chunk_that_inflates_beyond_itself(file):
    rows = 1 << 20
    made = replace(file, POINTS, None, shape=(rows, 3), dtype="<f4", chunks=(rows, 3),
                   compression="gzip")
    made.id.write_direct_chunk((0, 0), deflated_zeros(512 << 20))


@way
def chunk_without_its_filters(file):
    """Stored as if nothing had been done to it, and shorter than the chunk."""
    made = replace(file, POINTS, None, shape=(5, 3), dtype="<f4", chunks=(5, 3), shuffle=True,
                   compression="gzip", fletcher32=True)
    made.id.write_direct_chunk((0, 0), bytes(17), filter_mask=0xFF)


@way
def chunk_without_its_deflation(file):
    made = replace(file, POINTS, None, shape=(5, 3), dtype="<f4", chunks=(5, 3),
                   compression="gzip")
    made.id.write_direct_chunk((0, 0), bytes(61), filter_mask=0x1)


@way
def chunk_longer_than_its_data(file):
    made = replace(file, POINTS, None, shape=(5, 3), dtype="<f4", chunks=(5, 3),
                   compression="gzip")
    made.id.write_direct_chunk((0, 0), zlib.compress(bytes(60)) + bytes(200))


@way
def type_wider(file):
    replace(file, BASIS, file[BASIS][...].astype("<f8"), chunks=file[BASIS].shape)


@way
def type_big_endian(file):
    replace(file, BASIS, file[BASIS][...].astype(">f4"), chunks=file[BASIS].shape)


@way
def type_compound(file):
    data = np.zeros((3, 3), dtype=[("x", "<u4"), ("y", "<f8")])
    replace(file, "cells/coordinates", data, chunks=data.shape)


@way
def type_reference(file):
    made = replace(file, "cells/coordinates", None, shape=(3, 3), dtype=h5py.ref_dtype,
                   chunks=(3, 3))
    made[0, 0] = file["cells"].ref


@way
def type_variable_length(file):
    made = replace(file, "cells/coordinates", None, shape=(3, 3),
                   dtype=h5py.vlen_dtype(np.dtype("<u4")), chunks=(3, 3))
    made[0, 0] = [1, 2, 3]


@way
def type_variable_text(file):
    replace(file, "provenance/description", ["x"], dtype=h5py.string_dtype(), chunks=(1,))


@way
def wrong_rank(file):
    replace(file, BASIS, file[BASIS][...].ravel(), chunks=(8,))


@way
def scalar(file):
    replace(file, "cells/mean_free_path_mm", np.float32(1))


@way
def empty(file):
    replace(file, POINTS, None, shape=(0, 3), dtype="<f4", chunks=(5, 3), maxshape=(None, 3))


@way
def group_in_place_of_a_dataset(file):
    del file["cells/coordinates"]
    file.create_group("cells/coordinates")


@way
def dataset_in_place_of_a_group(file):
    del file["cells"]
    file["cells"] = np.zeros(3)


@way
def not_a_number(file):
    change(file, BASIS, lambda values: values.itemset(0, np.nan))


@way
def infinite_point(file):
    change(file, POINTS, lambda values: values.itemset(4, np.inf))


@way
def infinite_half(file):
    change(file, "iirtf/transfer", lambda values: values.itemset(4, np.inf))


@way
def cell_out_of_range(file):
    change(file, "cells/cell_of_segment", lambda values: values.itemset(0, 0xFFFFFFFF))


@way
def strands_that_overflow(file):
    change(file, "exemplar/strands", lambda values: values.itemset(0, 0xFFFFFFFF))


@way
def yarn_out_of_range(file):
    change(file, "exemplar/threads", lambda values: values.itemset(0, 7))


@way
def contradicting_counts(file):
    replace(file, BASIS, file[BASIS][...][1:], chunks=(1, 8, 8))


@way
def terminal_codes_in_a_name(file):
    names = np.array([b"silk\x1b]0;owned\x07", b"cotton"], dtype=h5py.string_dtype("utf-8", 20))
    replace(file, "exemplar/material_names", names, chunks=(2,))


@way
def text_of_another_kind(file):
    data = np.array([b"silk", b"cotton"])
    replace(file, "exemplar/material_names", data, chunks=(2,))


@way
def huge_attribute(file):
    for name in ("note", "more"):
        file["cells/coordinates"].attrs[name] = np.zeros(60000, "u1")


@way
def many_attributes(file):
    for i in range(200):
        file["cells"].attrs[f"note{i}"] = i


@way
def many_objects(file):
    for i in range(1000):
        file.create_group(f"cells/more{i}")


@way
def deep_groups(file):
    file.create_group("cells/" + "/".join(["deeper"] * 500))


def with_another_user_block(source, path):
    """The HDF5 part begins where the library would find it, and we do not."""
    with h5py.File(source) as old, h5py.File(path, "w", userblock_size=2048) as new:
        for name in old:
            old.copy(name, new)


def cut_short(source, path):
    data = pathlib.Path(source).read_bytes()
    pathlib.Path(path).write_bytes(data[: len(data) * 2 // 3])


def without_hdf5(source, path):
    pathlib.Path(path).write_bytes(bytes(USER_BLOCK_BYTES) + b"no HDF5 at all" * 1000)


def main():
    source, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    for name, edit in WAYS.items():
        path = folder / f"{name}.h5"
        shutil.copy(source, path)
        with h5py.File(path, "r+") as file:
            edit(file)
        seal(path)
    for make in (with_another_user_block, cut_short, without_hdf5):
        path = folder / f"{make.__name__}.h5"
        make(source, path)
        seal(path)


main()
