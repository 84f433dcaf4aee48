"""Makes graphs/assets/images/grass.png: dry grass seen from above, 0.5 m square at 1024 pixels per metre, that repeats without a seam.

Blades are painted one over the other, the lowest first: each a bent strip that tapers to its tip, in a tone of its own, lit on one side
and dark along its rib, and the darker the lower it lies. Painted at twice the size and halved.

    python3 tests/oracles/grass.py graphs/assets/images/grass.png
"""
import math
import random
import struct
import sys
import zlib

SIZE, BLADES = 512, 5200
WIDE = 2 * SIZE
draw = random.Random(11)
image = [[26.0] * WIDE for _ in range(WIDE)]


def blade(height):
    x, y = draw.uniform(0, WIDE), draw.uniform(0, WIDE)
    # Most lie as the wind has laid them.
    angle = draw.gauss(0.6, 0.7) if draw.random() < 0.75 else draw.uniform(0, 2 * math.pi)
    length, bend, width = draw.uniform(70, 230), draw.gauss(0, 0.5), draw.uniform(4, 10)
    tone = 60 + 110 * height + draw.gauss(0, 14)
    light = 0.2 if math.cos(angle) > 0 else -0.2
    steps = int(1.5 * length)
    edges = int(1.5 * width) + 1
    for k in range(steps):
        t = k / steps
        sin, cos = math.sin(angle + bend * t), math.cos(angle + bend * t)
        x, y = x + cos / 1.5, y + sin / 1.5
        half = 0.5 * width * min(1.0, 4 * (t + 0.05)) * (1 - t**2.5)
        for j in range(-edges, edges + 1):
            across = j / edges
            # A rib in the middle, light from one side, a tip that catches more of it.
            shade = 0.86 + light * across - (0.22 if abs(across) < 0.12 else 0.0) + 0.2 * t
            column, row = round(x - across * half * sin) % WIDE, round(y + across * half * cos) % WIDE
            image[row][column] = tone * shade


for number in range(BLADES):
    blade(number / BLADES)


def pixel(x, y):
    four = sum(image[2 * y + j][2 * x + i] for i in (0, 1) for j in (0, 1)) / 4
    return min(max(round(four + draw.gauss(0, 2)), 0), 255)


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


rows = b""
for y in range(SIZE):
    row = [pixel(x, y) for x in range(SIZE)]
    # Each pixel by its left neighbour.
    rows += b"\1" + bytes((b - a) % 256 for a, b in zip([0] + row, row))
header = struct.pack(">IIBBBBB", SIZE, SIZE, 8, 0, 0, 0, 0)
png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
open(sys.argv[1], "wb").write(png)
