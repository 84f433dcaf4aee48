"""Makes graphs/assets/images/tiles.png: a floor of tiles, 1 m square at 512 pixels per metre, that repeats without a seam.

Ten by ten tiles of 0.1 m (51.2 pixels), parted by gaps of 4 mm that lie at 0.05 m, 0.15 m, ... so that the origin is the
middle of a tile. Each pixel shows the mean over its square, so that the gaps keep their pitch of 51.2 pixels exactly.

    python3 tests/oracles/tiles.py graphs/assets/images/tiles.png
"""
import struct
import sys
import zlib

SIZE, TILES, GAP = 512, 10, 0.004 * 512
TILE, GROUT = 200, 60


def covered(x):
    """The part of pixel x (of width 1 about its centre) that lies in a gap."""
    pitch = SIZE / TILES
    middle = (round(x / pitch - 0.5) + 0.5) * pitch
    low, high = max(x - 0.5, middle - GAP / 2), min(x + 0.5, middle + GAP / 2)
    return max(high - low, 0.0)


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


line = [covered(x) for x in range(SIZE)]
rows = b""
for y in range(SIZE):
    # A pixel is tile where it is outside of both gaps.
    rows += b"\0" + bytes(round(GROUT + (TILE - GROUT) * (1 - a) * (1 - line[y])) for a in line)
header = struct.pack(">IIBBBBB", SIZE, SIZE, 8, 0, 0, 0, 0)
png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
open(sys.argv[1], "wb").write(png)
