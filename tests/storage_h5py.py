"""What another program reads in a fabric database: prints shapes and some values of FILE as JSON."""

import json
import sys

import h5py


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


print(json.dumps(read(sys.argv[1])))
