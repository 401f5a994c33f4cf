#!/usr/bin/env python3
"""Writes a few small valid files of every format that knurl reads, for the fuzz targets to start from."""

import base64
import json
import pathlib
import struct
import sys
import zlib


def png(depth, color, width=4, height=3):
    channels = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[color]
    row = (width * channels * depth + 7) // 8
    rows = b"".join(b"\0" + bytes((17 * (x + y)) & 255 for x in range(row)) for y in range(height))

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    palette = chunk(b"PLTE", bytes(range(48))) if color == 3 else b""
    header = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + palette
            + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def tiff(bits, sample_format, width=4, height=3):
    data = bytes(i & 63 for i in range(width * height * bits // 8))
    tags = [(256, 3, width), (257, 3, height), (258, 3, bits), (259, 3, 1), (262, 3, 1), (273, 4, 8),
            (277, 3, 1), (278, 3, height), (279, 4, len(data)), (339, 3, sample_format)]
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    return (b"II*\0" + struct.pack("<I", 8 + len(data)) + data
            + struct.pack("<H", len(tags)) + entries + struct.pack("<I", 0))


def exr(width=4, height=3):
    def attribute(name, kind, value):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<I", len(value)) + value

    box = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    channels = b"Y\0" + struct.pack("<iBBBBii", 2, 0, 0, 0, 0, 1, 1) + b"\0"
    head = (struct.pack("<II", 20000630, 2) + attribute("channels", "chlist", channels)
            + attribute("compression", "compression", b"\0") + attribute("dataWindow", "box2i", box)
            + attribute("displayWindow", "box2i", box) + attribute("lineOrder", "lineOrder", b"\0")
            + attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
            + attribute("screenWindowCenter", "v2f", struct.pack("<ff", 0, 0))
            + attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + b"\0")
    start = len(head) + 8 * height
    lines = [struct.pack("<ii", y, 4 * width) + struct.pack("<%df" % width, *range(width)) for y in range(height)]
    return head + b"".join(struct.pack("<Q", start + y * len(lines[0])) for y in range(height)) + b"".join(lines)


def hdr(width=8, height=2):
    plain = bytes((128, 64, 32, 129)) * width
    packed = b"\2\2" + struct.pack(">H", width) + b"".join(bytes((128 + width, v)) for v in (128, 64, 32, 129))
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width)
    return head + plain * height, head + packed * height


def gltf_parts():
    positions = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0, 1)
    normals = struct.pack("<12f", *([0, 1, 0] * 4))
    texcoords = struct.pack("<8f", 0, 0, 1, 0, 1, 1, 0, 1)
    indices = struct.pack("<6H", 0, 2, 1, 0, 3, 2)
    blocks = [positions, normals, texcoords, indices]
    offsets = [sum(len(b) for b in blocks[:i]) for i in range(4)]
    image = base64.b64encode(png(8, 0)).decode()
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_displacement", "KHR_texture_transform", "KHR_lights_punctual"],
        "buffers": [{"byteLength": sum(len(b) for b in blocks)}],
        "bufferViews": [{"buffer": 0, "byteOffset": o, "byteLength": len(b)} for o, b in zip(offsets, blocks)],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 0, 1]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "images": [{"uri": "data:image/png;base64," + image}],
        "samplers": [{"wrapS": 33648, "wrapT": 33071}],
        "textures": [{"source": 0, "sampler": 0}],
        "materials": [{
            "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.2, 1], "roughnessFactor": 0.4},
            "extensions": {"KHR_materials_displacement": {
                "displacementGeometryTexture": {"index": 0, "extensions": {"KHR_texture_transform": {
                    "offset": [0.1, 0.2], "rotation": 0.3, "scale": [2, 3]}}},
                "displacementGeometryFactor": 0.1,
                "displacementGeometryOffset": -0.05}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2},
                                    "indices": 3, "material": 0}]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 5,
                                                           "spot": {"outerConeAngle": 0.5}}]}},
        "nodes": [{"mesh": 0, "children": [1]}, {"camera": 0, "translation": [0, 1, 3]},
                  {"rotation": [0, 0, 0, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "scenes": [{"nodes": [0, 2]}], "scene": 0}
    return document, b"".join(blocks)


def gltf_files():
    document, data = gltf_parts()
    text = dict(document)
    text["buffers"] = [{"byteLength": len(data),
                        "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}]
    packed = json.dumps(document).encode()
    packed += b" " * (-len(packed) % 4)
    data += b"\0" * (-len(data) % 4)
    size = 12 + 8 + len(packed) + 8 + len(data)
    glb = (b"glTF" + struct.pack("<II", 2, size) + struct.pack("<I", len(packed)) + b"JSON" + packed
           + struct.pack("<I", len(data)) + b"BIN\0" + data)
    return json.dumps(text).encode(), glb


OBJ = b"""mtllib a.mtl
v 0 0 0
v 1 0 0
v 1 0 1
v 0 0 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 1 0
usemtl m
f 1/1/1 4/4/1 3/3/1 2/2/1
f -4//1 -3//1 -2//1
"""

MTL = b"""newmtl m
Kd 0.8 0.7 0.6
Ke 0 0 0
Ns 100
d 1
map_Kd -s 2 2 1 color.png
disp -bm 0.1 -mm 0.0 1.0 -o 0.5 0.5 0 -clamp on height.png
"""

PLY = b"""ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""


def main():
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    text, binary = gltf_files()
    plain, packed = hdr()
    files = {
        "gray1.png": png(1, 0), "gray16.png": png(16, 0), "palette.png": png(4, 3), "rgb.png": png(8, 2),
        "rgba16.png": png(16, 6), "gray8.tif": tiff(8, 1), "gray16.tif": tiff(16, 1), "float.tif": tiff(32, 3),
        "y.exr": exr(), "plain.hdr": plain, "packed.hdr": packed,
        "a.pgm": b"P5\n# remark\n2 2\n65535\n\0\1\0\2\0\3\0\4", "b.pgm": b"P2 2 2 255 0 1 2 3",
        "c.ppm": b"P6 1 1 255\nabc", "d.ppm": b"P3\n1 1\n9\n1 2 3\n",
        "e.pfm": b"Pf\n2 1\n-1.0\n" + struct.pack("<2f", 0.5, 2), "f.pfm": b"PF\n1 1\n1.0\n" + struct.pack(">3f", 1, 2, 3),
        "scene.gltf": text, "scene.glb": binary, "mesh.obj": OBJ, "mesh.mtl": MTL, "mesh.ply": PLY,
        "rays.csv": b"ox,oy,oz,dx,dy,dz,tmin,tmax\n0,1,0,0,-1,0,0,inf\n",
    }
    for name, data in files.items():
        (folder / name).write_bytes(data)


if __name__ == "__main__":
    main()
