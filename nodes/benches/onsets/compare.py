"""F-measures of librosa and aubio on the labels; the argument is a list of `name,path` of the recordings that exist."""

import csv
import sys
from collections import defaultdict
from pathlib import Path

import aubio
import librosa
import numpy as np
import soundfile

HERE = Path(__file__).parent
TOLERANCE, EDGE = 0.025, 0.01


def table(name):
    with open(HERE / name, newline="") as file:
        return list(csv.DictReader(file))


with open(sys.argv[1], newline="") as file:
    paths = dict(csv.reader(file))
spans, labels = defaultdict(list), defaultdict(list)
for row in table("spans.csv"):
    spans[row["recording"]].append((float(row["start_s"]), float(row["end_s"])))
for row in table("onsets.csv"):
    labels[row["recording"]].append(float(row["onset_s"]))
sounds = {}
for name, path in paths.items():
    samples, rate = soundfile.read(path, always_2d=True, dtype="float32")
    sounds[name] = (samples.mean(axis=1), rate)


def pairs(wanted, found):
    i = j = count = 0
    while i < len(wanted) and j < len(found):
        if found[j] < wanted[i] - TOLERANCE:
            j += 1
        elif found[j] > wanted[i] + TOLERANCE:
            i += 1
        else:
            i, j, count = i + 1, j + 1, count + 1
    return count


def f_measure(detect):
    right = wrong = missed = 0
    for name, (samples, rate) in sounds.items():
        found, wanted = sorted(detect(samples, rate)), sorted(labels[name])
        inside = [
            t
            for t in found
            if any((s == 0 or t >= s + EDGE) and t <= e - EDGE for s, e in spans[name])
        ]
        hits = pairs(wanted, found)
        right += hits
        wrong += len(inside) - pairs(wanted, inside)
        missed += len(wanted) - hits
    return 2 * right / max(2 * right + wrong + missed, 1)


def of_librosa(hop, delta):
    def detect(x, rate):
        strength = librosa.onset.onset_strength(y=x, sr=rate, hop_length=hop, n_fft=max(1024, 4 * hop))
        return librosa.onset.onset_detect(
            onset_envelope=strength, sr=rate, hop_length=hop, units="time", delta=delta
        )

    return detect


def of_aubio(method, threshold, interval):
    def detect(x, rate):
        onset = aubio.onset(method, 1024, 256, rate)
        onset.set_threshold(threshold)
        onset.set_minioi_s(interval)
        x = np.concatenate([x, np.zeros(1024 + -len(x) % 256, np.float32)])
        return [onset.get_last_s() for i in range(0, len(x), 256) if onset(x[i : i + 256])]

    return detect


print(f"librosa {librosa.__version__}, default: F {f_measure(of_librosa(512, 0.07)):.3f}")
best = max((f_measure(of_librosa(128, d)), d) for d in (0.07, 0.1, 0.15, 0.2, 0.3))
print(f"librosa, hop 128, best delta of these labels {best[1]}: F {best[0]:.3f}")
for interval in (0.05, 0.02):
    best = max(
        (f_measure(of_aubio(method, threshold, interval)), method, threshold)
        for method in ("hfc", "complex", "specflux", "mkl")
        for threshold in (0.1, 0.2, 0.3, 0.5, 0.8)
    )
    print(
        f"aubio, {1000 * interval:.0f} ms apart at least, best of these labels {best[1]} {best[2]}: F {best[0]:.3f}"
    )
