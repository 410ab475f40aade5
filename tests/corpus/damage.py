"""What may happen to bytes on their way: cut, flipped, swapped, doubled, padded, in another encoding."""

from __future__ import annotations

import gzip

from corpus.case import Damage
from numpy.random import Generator


def cut(share: float) -> Damage:
    """The first part alone; where exactly it ends is drawn."""

    def damage(content: bytes, rng: Generator) -> bytes:
        around = max(1, len(content) // 50)
        return content[: max(1, int(share * len(content)) - int(rng.integers(around)))]

    return damage


def short(count: int) -> Damage:
    """Without the last bytes."""
    return lambda content, _rng: content[:-count]


def flip(count: int, start: int = 0, end: int | None = None) -> Damage:
    """Single bits turned at drawn places from ``start`` to ``end``."""

    def damage(content: bytes, rng: Generator) -> bytes:
        changed = bytearray(content)
        stop = len(content) if end is None else min(end, len(content))
        for position in rng.integers(min(start, stop - 1), stop, count):
            changed[position] ^= 1 << int(rng.integers(8))
        return bytes(changed)

    return damage


def noise(start: int, count: int) -> Damage:
    """Random bytes in the place of some."""
    return lambda content, rng: content[:start] + rng.bytes(count) + content[start + count :]


def swap(size: int, start: int = 0) -> Damage:
    """Two drawn blocks change places."""

    def damage(content: bytes, rng: Generator) -> bytes:
        blocks = [content[i : i + size] for i in range(start, len(content), size)]
        one, other = rng.choice(len(blocks) - 1, 2, replace=False)
        blocks[one], blocks[other] = blocks[other], blocks[one]
        return content[:start] + b"".join(blocks)

    return damage


def hole(size: int) -> Damage:
    """A drawn block in the middle is missing."""

    def damage(content: bytes, rng: Generator) -> bytes:
        start = int(rng.integers(len(content) // 4, len(content) // 2))
        return content[:start] + content[start + size :]

    return damage


def zeros(size: int) -> Damage:
    """A drawn block in the middle is zero, as after a crash of the machine."""

    def damage(content: bytes, rng: Generator) -> bytes:
        start = int(rng.integers(len(content) // 4, len(content) // 2))
        return content[:start] + bytes(size) + content[start + size :]

    return damage


def ended_with(more: bytes) -> Damage:
    """Something after the end."""
    return lambda content, _rng: content + more


def begun_with(more: bytes) -> Damage:
    """Something before the beginning."""
    return lambda content, _rng: more + content


def doubled(content: bytes, _rng: Generator) -> bytes:
    """The file twice, one after the other."""
    return content + content


def joined(other: bytes) -> Damage:
    """The first half, and the second half of something else."""
    return lambda content, _rng: content[: len(content) // 2] + other[len(other) // 2 :]


def gzipped(content: bytes, _rng: Generator) -> bytes:
    """Packed."""
    return gzip.compress(content, mtime=0)


def replaced(old: bytes, new: bytes, count: int = -1) -> Damage:
    """Some bytes for others wherever they stand; they have to stand there."""

    def damage(content: bytes, _rng: Generator) -> bytes:
        assert old in content, old
        return content.replace(old, new, count)

    return damage


def encoded(codec: str) -> Damage:
    """Text in UTF-8 in another encoding."""
    return lambda content, _rng: content.decode().encode(codec, "replace")


STRANGERS = {
    "nothing": b"",
    "one byte": b"\n",
    "zeros": bytes(4096),
    "a web page": b"<!DOCTYPE html>\n<html><head><title>404</title></head><body>gone</body></html>\n",
    "a zip": b"PK\x03\x04\x14\x00\x00\x00\x08\x00" + bytes(range(256)) * 4,
    "a picture": b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x01\x00" + bytes(range(256)) * 4,
    "a text": b"Dear colleague,\nplease find the scan attached.\nKind regards\n",
    "a pointer": b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 64084\n",
}
"""Files of other kinds under a good name, by what they are."""
