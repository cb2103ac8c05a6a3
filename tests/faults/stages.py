"""The commands of tests/campaign, what they read, and what holds of what they leave."""
import math
import re
import struct

HEADS = {".atlas.tif": ".rbvh", ".obj": ".vdm.json", ".vdm.exr": ".vdm.json"}  # of a part, its head
ASIDE = re.compile(r"\.[0-9a-f]{16}(?=\.[^.]+$)")  # NAME.HASH.EXT, a part beside its place


class Stage:
    """A command that writes into out/; `other` writes the older outputs that it replaces."""

    def __init__(self, name, words, uses_device=True, other=None):
        self.name, self.uses_device, self.is_in_place = name, uses_device, other is not None
        self.words = words.split() + ["-f"]
        self.other = other.split() + ["-f"] if other else [word.replace("ball.", "small.") for word in self.words]
        self.old, self.new, self.seconds = {}, {}, 0  # file name: bytes

    @property
    def files_at_once(self):
        """Temporary files that a killed run may leave."""
        return max(1 + len(parts_of(self, head)) for head in heads_of(self))


BUILD = "build ball.ply -o out/a.rbvh --levels Q4"
STAGES = [
    Stage("ingest", "ingest ball.ply -o out/a.ply", uses_device=False),
    Stage("mesh", "mesh ball.rbvh -o out/a.glb", uses_device=False),
    Stage("view", "view ball.rbvh -o out/a.html", uses_device=False),
    Stage("lod", "lod ball.rbvh --levels Q4 -o out/a.rbvh"),
    Stage("build", BUILD),
    Stage("paint", "paint out/a.rbvh --layer wear --points p.npy --values v.npy", other=BUILD),
    Stage("sample", "sample ball.rbvh --layer normal --points p.npy -o out/a.npy"),
    Stage("proxy", "proxy ball.ply -o out/a.obj --patches 60"),
    Stage("png", "render ball.rbvh -o out/a.png --resolution 64,64"),
    Stage("exr", "render ball.rbvh -o out/a.exr --resolution 40,40"),
    Stage("turntable", "render ball.rbvh -o out/{frame}.jpg --turntable 3 --resolution 48,48"),
    Stage("trace", "trace ball.rbvh --rays rays.npy -o out/a.npy"),
]


def ball(rings):
    """A bumpy ball, as an ASCII PLY."""
    around, vertices, faces = 2 * rings, [], []
    for i in range(rings + 1):
        for j in range(around):
            p, t = math.pi * i / rings, 2 * math.pi * j / around
            r = 1 + 0.05 * math.sin(6 * t) * math.sin(5 * p)
            vertices.append(f"{r * math.sin(p) * math.cos(t):.7g} {r * math.cos(p):.7g} {-r * math.sin(p) * math.sin(t):.7g}\n")
    for i in range(rings):
        for j in range(around):
            a, b = i * around + j, i * around + (j + 1) % around
            if i > 0:
                faces.append(f"3 {a} {a + around} {b}\n")
            if i + 1 < rings:
                faces.append(f"3 {b} {a + around} {b + around}\n")
    head = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n"
    return (head.format(len(vertices), len(faces)) + "property list uchar int vertex_indices\nend_header\n" +
            "".join(vertices + faces)).encode()


def npy(rows):
    head = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({len(rows)}, {len(rows[0])}), }}".ljust(117) + "\n"
    values = b"".join(struct.pack(f"<{len(row)}f", *row) for row in rows)
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + values


def inputs():
    rays = [[x / 30 - 1, 0, 6, 0, 0, -1] for x in range(60)]
    return {"ball.ply": ball(16), "small.ply": ball(10), "p.npy": npy([[0, 1, 0], [0, -1, 0]]), "v.npy": npy([[7], [9]]),
            "rays.npy": npy(rays)}


def head_of(stage, name):
    """The output that names this one by its hash, or itself."""
    for end, head in HEADS.items():
        if name.endswith(end) and name[:-len(end)] + head in stage.new:
            return name[:-len(end)] + head
    return name


def heads_of(stage):
    return [name for name in stage.new if head_of(stage, name) == name]


def parts_of(stage, head):
    return [name for name in stage.new if name != head and head_of(stage, name) == head]


def version_of(stage, files, old, head):
    """Of an output with its parts: "new", "old", or what is wrong."""
    if head not in files:
        return f"{head} is gone" if head in old else "old"
    wrong = f"{head} is neither the old one nor the new one"
    for name, version in (("new", stage.new), ("old", old)):
        if files[head] == version.get(head):
            whole = all(any(ASIDE.sub("", file) == part and content == version[part] for file, content in files.items())
                        for part in parts_of(stage, head))
            if whole:
                return name
            wrong = f"{head} is the {name} one, without its parts"
    return wrong


def faults_of(stage, files, old, is_done, may_leave):
    """What is wrong with what a run left."""
    versions = [version_of(stage, files, old, head) for head in heads_of(stage)]
    faults = [version for version in versions if version not in ("old", "new")]
    if is_done and not faults and "old" in versions:
        faults.append("exit 0, and the outputs are not new")
    left = [name for name in files if name.startswith(".") and not name.endswith(".lock")]
    if len(left) > may_leave:
        faults.append(f"leaves {left}")
    strange = [name for name in files if not name.startswith(".") and ASIDE.sub("", name) not in stage.new]
    if strange:
        faults.append(f"leaves {strange}")
    return faults


def is_new(stage, files):
    return files == stage.new
