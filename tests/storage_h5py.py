"""What another program does with a fabric database: reads it, or tampers with it.

read FILE                prints shapes, attributes and some values as JSON
tamper FROM TO HOW       copies a database, does HOW to it, and seals it with a right digest
"""

import hashlib
import json
import os
import shutil
import sys

import h5py
import numpy as np

USER_BLOCK_BYTES = 512


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


def tamper(file, how):
    basis = file["visibility/ssdf/basis"][...]
    if how == "nothing":
        pass
    elif how == "missing":
        del file["cells/coordinates"]
    elif how == "soft_link":
        file.move("cells/coordinates", "cells/moved")
        file["cells/coordinates"] = h5py.SoftLink("/cells/moved")
    elif how == "external_link":
        del file["cells/coordinates"]
        file["cells/coordinates"] = h5py.ExternalLink("other.h5", "/x")
    elif how == "external_group":
        del file["cells"]
        file["cells"] = h5py.ExternalLink("other.h5", "/cells")
    elif how == "external_storage":
        replace(file, "visibility/ssdf/basis", None, shape=basis.shape, dtype="<f4",
                external=[("/etc/passwd", 0, basis.nbytes)])
    elif how == "virtual":
        del file["visibility/ssdf/basis"]
        layout = h5py.VirtualLayout(shape=basis.shape, dtype="<f4")
        layout[...] = h5py.VirtualSource("other.h5", "x", shape=basis.shape)
        file.create_virtual_dataset("visibility/ssdf/basis", layout)
    elif how == "foreign_filter":
        replace(file, "visibility/ssdf/basis", basis, chunks=basis.shape, compression="lzf")
    elif how == "huge_shape":
        replace(file, "exemplar/points_mm", None, shape=(1 << 40, 3), dtype="<f4",
                chunks=(1 << 20, 3), compression="gzip")
    elif how == "bomb":
        zeros = np.zeros((1 << 20, 3), "<f4")
        replace(file, "exemplar/points_mm", zeros, chunks=(1 << 20, 3), compression="gzip")
    elif how == "wrong_type":
        replace(file, "visibility/ssdf/basis", basis.astype("<f8"), chunks=basis.shape)
    elif how == "wrong_rank":
        replace(file, "visibility/ssdf/basis", basis.ravel(), chunks=(8,))
    elif how == "scalar":
        replace(file, "cells/mean_free_path_mm", np.float32(1))
    elif how == "group_in_place":
        del file["cells/coordinates"]
        file.create_group("cells/coordinates")
    elif how == "variable_text":
        replace(file, "provenance/description", ["x"], dtype=h5py.string_dtype(), chunks=(1,))
    elif how == "not_finite":
        basis[0, 0, 0] = np.nan
        replace(file, "visibility/ssdf/basis", basis, chunks=basis.shape)
    elif how == "contradicting_counts":
        replace(file, "visibility/ssdf/basis", basis[1:], chunks=(1, 8, 8))
    else:
        raise SystemExit(f"unknown way to tamper: {how}")


def read(path):
    with h5py.File(path) as file:
        transfer = file["iirtf/transfer"]
        shapes, bare = {}, []

        def visit(name, item):
            if isinstance(item, h5py.Dataset):
                shapes[name] = list(item.shape)
                if not {"units", "axes", "description"} <= set(item.attrs) or not item.fletcher32:
                    bare.append(name)
                item[...]

        file.visititems(visit)
        return {
            "user_block": file.userblock_size,
            "shapes": shapes,
            "bare": bare,
            "transfer_type": transfer.dtype.str,
            "transfer": transfer[...].astype(float).ravel().tolist(),
            "material_names": [name.decode() for name in file["exemplar/material_names"]],
            "description": file["provenance/description"][0].decode(),
            "phi": file["visibility/ssdf/basis"].dims[2][0][...].astype(float).tolist(),
        }


def main():
    if sys.argv[1] == "read":
        print(json.dumps(read(sys.argv[2])))
        return
    shutil.copy(sys.argv[2], sys.argv[3])
    with h5py.File(sys.argv[3], "r+") as file:
        tamper(file, sys.argv[4])
    seal(sys.argv[3])


main()
