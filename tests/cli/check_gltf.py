"""Checks that a glTF file that knurl wrote is sound.

Every accessor lies inside its view and its min and max are true; indices are in range; normals have unit
length and triangles turn counter-clockwise around them; displacement names a texture that exists; files
that are named are there; and meshes that are closed by position are listed. Ends with 1 at the first fault.
"""
import json
import os
import struct
import sys

import numpy as np

TYPES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
COMPONENTS = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
# Meshes whose edges must each be shared by exactly two triangles, compared by the bits of the positions.
CLOSED = {"ring", "ball", "urchin", "planet", "moon", "slab", "carved", "pillow", "burst", "coral", "knurled ring",
          "crate", "glass"}


def load(path):
    data = open(path, "rb").read()
    folder = os.path.dirname(path)
    if data[:4] != b"glTF":
        document = json.loads(data)
        return document, [open(os.path.join(folder, b["uri"]), "rb").read() for b in document["buffers"]]
    _, version, total = struct.unpack_from("<III", data)
    assert version == 2 and total == len(data), "glb header"
    size, kind = struct.unpack_from("<II", data, 12)
    assert kind == 0x4E4F534A and size % 4 == 0, "JSON chunk"
    document = json.loads(data[20:20 + size])
    binary, kind = struct.unpack_from("<II", data, 20 + size)
    assert kind == 0x004E4942 and 28 + size + binary == total, "binary chunk"
    assert "uri" not in document["buffers"][0]
    return document, [data[28 + size:]]


def read(document, buffers, index):
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    width = TYPES[accessor["type"]]
    kind = np.dtype(COMPONENTS[accessor["componentType"]])
    offset = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    assert offset % kind.itemsize == 0, "alignment"
    assert accessor["count"] * width * kind.itemsize <= view["byteLength"], "accessor larger than its view"
    assert view["byteOffset"] + view["byteLength"] <= document["buffers"][0]["byteLength"] <= len(buffers[0])
    values = np.frombuffer(buffers[view["buffer"]], kind, accessor["count"] * width, offset)
    values = values.reshape(accessor["count"], width)
    if "min" in accessor:
        assert np.array_equal(values.min(0), np.array(accessor["min"], kind)), "min"
        assert np.array_equal(values.max(0), np.array(accessor["max"], kind)), "max"
    return values


def check_closed(name, positions, triangles):
    _, same = np.unique(positions.view(np.uint32).reshape(len(positions), 3), axis=0, return_inverse=True)
    corners = same.reshape(-1)[triangles]
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    forward = set(map(tuple, edges))
    assert len(forward) == len(edges), name + ": an edge is used twice in one direction"
    assert all((b, a) in forward for a, b in forward), name + ": open"


def check_mesh(document, buffers, mesh):
    for primitive in mesh["primitives"]:
        positions, normals, texcoords = (read(document, buffers, primitive["attributes"][key])
                                         for key in ("POSITION", "NORMAL", "TEXCOORD_0"))
        triangles = read(document, buffers, primitive["indices"]).reshape(-1, 3)
        assert len(positions) == len(normals) == len(texcoords)
        assert triangles.max() < len(positions), "index out of range"
        assert np.isfinite(positions).all() and np.isfinite(texcoords).all()
        assert abs(np.linalg.norm(normals, axis=1) - 1).max() < 1e-6, "unit normals"
        p = positions[triangles].astype(float)
        facing = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        assert (np.linalg.norm(facing, axis=1) > 0).all(), mesh["name"] + ": triangle without area"
        assert ((facing * normals[triangles].sum(1)).sum(1) > 0).all(), mesh["name"] + ": winding"
        assert primitive["material"] < len(document["materials"])
        if mesh["name"] in CLOSED:
            check_closed(mesh["name"], positions, triangles)


def main(path):
    document, buffers = load(path)
    folder = os.path.dirname(path)
    assert document["asset"]["version"] == "2.0"
    for image in document.get("images", []):
        assert os.path.isfile(os.path.join(folder, image["uri"])), image["uri"]
    for texture in document.get("textures", []):
        assert texture["source"] < len(document["images"]) and texture["sampler"] < len(document["samplers"])
    used = set(document.get("extensionsUsed", []))
    displaced = 0
    for material in document["materials"]:
        assert set(material.get("extensions", {})) <= used
        displacement = material.get("extensions", {}).get("KHR_materials_displacement")
        if displacement:
            displaced += 1
            texture = displacement["displacementGeometryTexture"]
            assert texture["index"] < len(document["textures"])
            scale = texture.get("extensions", {}).get("KHR_texture_transform", {}).get("scale", [1, 1])
            assert all(s == int(s) for s in scale), "whole tiles"
            assert displacement["displacementGeometryFactor"] != 0
    assert displaced > 0, "nothing is displaced"
    for mesh in document["meshes"]:
        check_mesh(document, buffers, mesh)
    for node in document["nodes"]:
        assert abs(np.linalg.norm(node.get("rotation", [0, 0, 0, 1])) - 1) < 1e-6
    assert sorted(document["scenes"][0]["nodes"]) == list(range(len(document["nodes"])))
    environment = document["scenes"][0]["extras"]["environment"]["image"]
    assert os.path.isfile(os.path.join(folder, environment))
    assert any("camera" in node for node in document["nodes"])


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except (AssertionError, KeyError, IndexError, ValueError, OSError) as fault:
        print(f"{sys.argv[1]}: {type(fault).__name__}: {fault}", file=sys.stderr)
        sys.exit(1)
