"""Files that nobody meant: seeded mutations of bytes, of JSON trees, of TOML text, of tables of numbers."""

import json
import os
import warnings
import zipfile

import numpy as np


class Spy:
    """Leaves a folder behind where a reader carries out what a file holds."""

    def __reduce__(self):
        return os.mkdir, ("spied",)


def broken_bytes(content, chance):
    """Bits flipped, stretches cut out, zeroed, doubled or made noise, ends cut off."""
    found = bytearray(content)
    for _ in range(int(chance.integers(1, 4))):
        size = max(len(found), 1)
        place, length = int(chance.integers(size)), int(min(chance.integers(1, 2 + size // 4), 4000))
        way = chance.integers(6)
        if way == 0 and found:
            found[place] ^= 1 << int(chance.integers(8))
        elif way == 1:
            del found[place : place + length]
        elif way == 2:
            found[place : place + length] = bytes(min(length, size - place))
        elif way == 3:
            found[place:place] = found[place : place + length]
        elif way == 4:
            found[place : place + length] = chance.bytes(length)
        else:
            del found[place:]
    return bytes(found)


def _deep(levels):
    tree = 1
    for _ in range(levels):
        tree = {"tuple": [tree]}
    return tree


ODD = (
    None, True, -1, 0, 10**9, 10**400, 1e308, -1e-320, "", "x", "\x1b[2J\n", "../../evil", [], {}, [[[]]], {"float": "nan"},
    {"float": "inf"},
    {"float": "one"}, {"array": "nowhere"}, {"array": 3}, {"tuple": [1, 2, 3]}, {"tuple": 3}, {"dict": [[1]]}, {"dict": [[[], 1]]},
    {"enum": "PlanStatus", "name": "SOLVED"}, {"enum": "Arm", "name": "length"}, {"enum": "PlanStatus", "name": "X"},
    {"type": "Arm", "fields": {}}, {"type": "os.system", "fields": {"command": "touch spied"}}, {"type": "Water", "fields": {"factor": -1}},
    {"type": [], "fields": 1}, _deep(20), _deep(200),
)  # fmt: skip
"""Values that no file of ours has where they are put."""


def places(tree, path=()):
    """Paths to everything in a JSON tree."""
    yield path
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, inner in items:
        yield from places(inner, (*path, key))


def odd_tree(tree, chance):
    """A JSON tree with one to three places that are odd, gone, or something else of the tree."""
    tree = json.loads(json.dumps(tree))
    for _ in range(int(chance.integers(1, 4))):
        known = [path for path in places(tree) if path]
        if not known:
            break
        path = known[int(chance.integers(len(known)))]
        target = tree
        for key in path[:-1]:
            target = target[key]
        way = chance.integers(4)
        if way == 0:
            del target[path[-1]]
        elif way == 1:
            source = tree
            for key in known[int(chance.integers(len(known)))]:
                source = source[key]
            target[path[-1]] = json.loads(json.dumps(source))
        else:
            target[path[-1]] = json.loads(json.dumps(ODD[int(chance.integers(len(ODD)))]))
    return tree


def odd_arrays(arrays, chance):
    """Arrays of which one has another shape, kind or content, or is missing."""
    arrays = dict(arrays)
    name = list(arrays)[int(chance.integers(len(arrays)))]
    value = arrays[name]
    ways = (
        lambda: value.ravel()[:0],
        lambda: value[..., None],
        lambda: value.ravel(),
        lambda: value.astype(complex),
        lambda: value.astype("U8"),
        lambda: np.full(value.shape, np.nan),
        lambda: value.astype(np.float32),
        lambda: np.array([Spy()], dtype=object),
        lambda: np.zeros(()),
        lambda: value.ravel()[::-1],
        lambda: np.full(value.shape, 1e300),
        lambda: np.resize(value, (3, *value.shape[1:])) if value.ndim else value,
    )
    way = int(chance.integers(len(ways) + 1))
    if way == len(ways):
        del arrays[name]
    else:
        arrays[name] = ways[way]()
    return arrays


def odd_archive(content, path, chance):
    """Write an archive of ours at a path with a header, arrays or bytes that are wrong."""
    way = chance.integers(4)
    with open(path, "wb") as file:
        file.write(content)
    if way == 0:
        path.write_bytes(broken_bytes(content, chance))
        return
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    header = json.loads(arrays.pop("header").tobytes())
    if way == 1:
        arrays = odd_arrays(arrays, chance)
    else:
        header = odd_tree(header, chance)
    np.savez(path, header=np.frombuffer(json.dumps(header).encode(), dtype=np.uint8), **arrays)
    if way == 3:
        with warnings.catch_warnings(), zipfile.ZipFile(path, "a") as archive:
            warnings.simplefilter("ignore")  # about two members of one name
            archive.writestr(["../evil.npy", "/evil.npy", "evil", "header.npy"][int(chance.integers(4))], b"evil")


def odd_text(text, chance):
    """Lines of TOML or CSV that are doubled, gone, swapped, or whose values are odd; or bytes that are."""
    if chance.integers(5) == 0:
        return broken_bytes(text.encode(), chance)
    lines = text.splitlines()
    for _ in range(int(chance.integers(1, 4))):
        place = int(chance.integers(len(lines)))
        way = chance.integers(5)
        if way == 0:
            del lines[place]
        elif way == 1:
            lines.insert(place, lines[int(chance.integers(len(lines)))])
        elif way == 2:
            lines[place] = lines[place][: int(chance.integers(len(lines[place]) + 1))]
        else:
            odd = ODD_WORDS[int(chance.integers(len(ODD_WORDS)))]
            for mark in ("=", ","):
                parts = lines[place].split(mark)
                if len(parts) > 1:
                    parts[int(chance.integers(1, len(parts)))] = odd
                    lines[place] = mark.join(parts)
                    break
        lines = lines or [""]
    return "\n".join(lines).encode()


ODD_WORDS = (
    "nan", "inf", "-1", "0", "1e309", "1e-320", "", '"x"', "true", "[]", "{}", "[[1, 2], []]", '"\\u0000"', "9" * 5000, '"100 parsec"', "x",
    "[" * 4000,
    '"../../evil"', "1979-05-27", "0x7f", '"50 %"', '"1e400 m"', "{ kind = 'Box' }",
)  # fmt: skip
