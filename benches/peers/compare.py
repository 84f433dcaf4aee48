"""Compares foley with programs beside it: run by compare.sh, which says how.

Each item is run by foley and by each of its programs in turn, `ROUNDS` times. A line of the table is a metric of foley beside the best of the
programs: median over the rounds, least and greatest, and the ratio foley / program. Figures are processor times or rates by them; where a
program prints no `.cpu` its figure itself is one. A program that is not there is reported and left out.
"""
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

PEERS = Path(os.environ["PEERS"]).absolute()
VENV = Path(os.environ.get("PEERS_VENV") or PEERS / ".venv-peers").absolute()
BUILD = Path(os.environ.get("PEERS_BUILD") or PEERS / ".peers-build").absolute()
ROUNDS = int(os.environ.get("ROUNDS", "2"))
T = os.environ.get("PEERS_THREADS", "1") + "t"
SIZES = ("512", "4096")
BANKS = ("64", "1000", "10000")
# Loops without a runtime or an interface: what the machine can do at most. They have a line of their own.
BOUNDS = {"floor:dyn-call-loop", "hand-C-f32x8", "hand-C-f32x16"}


def python(script, *names):
    return [[str(VENV / "bin/python"), script, name] for name in names]


def rust(program, *args):
    return [str(BUILD / "target/release" / program), *args]


def c(name, source, *flags):
    """A C program, which is built first."""
    return ["cc", name, source, *flags]


BANK = ("c/modal_bound.c", "-ffast-math", "-lm")
# The programs of each item, and for each metric of foley those of the programs, as PROGRAM/METRIC; without a metric it is the same.
ITEMS = {
    "01": (
        [rust("dsp", "mfcc"), *python("item01_mfcc.py", "librosa", "numpy-hand", "essentia", "torchaudio")],
        {m: ["realfft-hand(1 thread)", "crate-spectrograms", "librosa", "numpy-hand", "essentia", "torchaudio"]
         for m in ("short", "usual")}),
    "02": (
        [rust("geo", "units"), *python("item02_units.py", "scipy-ckdtree", "ckdtree+numba")],
        {m.format(d): p for d in (3, 6) for m, p in (
            ("build.d{}", ["kiddo", "scipy-ckdtree"]), (f"whole.d{{}}.{T}", [f"kiddo+hand-D2/whole.d{d}.1t", "ckdtree+numba"]))}),
    "03": (
        python("item03_tps.py", "scipy-rbfinterpolator", "numpy-dense"),
        {m: ["scipy-rbfinterpolator", "numpy-dense"] for m in ("fit.419x3out", "eval.140k.3out")}),
    "04": (
        python("item04_emg.py", "scipy-optimize"),
        {"fit": ["scipy:" + m for m in ("handgrad+BFGS", "handgrad+L-BFGS-B", "exponnorm+L-BFGS-B", "exponnorm+NelderMead")]}),
    "05": (
        python("item05_onset.py", "librosa", "scipy-hand", "essentia", "aubio"),
        {"flux+pick.225s": ["librosa", "essentia", "aubio"], "flux.225s": ["scipy-hand"]}),
    "06": (
        python("item06_ncc.py", "scipy-fft-cached-overlap-save", "opencv-matchTemplate", "torch-fft-cached-overlap-save"),
        {"whole-extrapolated": ["scipy-fft-cached-overlap-save", "opencv-matchTemplate", "torch-fft-cached-overlap-save"]}),
    "07": (
        python("item07_wavelet.py", "pywavelets", "numpy-wavelet-tree"),
        {**{f"{m}.{t}": ["pywavelets"] for t in ("float64", "float32") for m in ("wavedec", "waverec")},
         "synthesis.2^11-samples": ["numpy-wavelet-tree"]}),
    "08": (
        python("item08_dtw.py", "numba-hand", "dtaidistance", "stumpy-match(z-norm-Euclid)"),
        {"best-match": ["numba-hand", "dtaidistance", "stumpy-match(z-norm-Euclid)"]}),
    "09": (
        [*python("item09_image.py", "opencv", "contourpy"), rust("geo", "image")],
        {m.format(n): p for n in SIZES for m, p in (
            (f"marching-squares.{{}}.{T}", [f"contourpy/marching-squares.{n}.{'serial' if T == '1t' else 'threaded'}", f"contour/marching-squares.{n}"]),
            (f"sobel.{{}}.{T}", ["opencv", f"imageproc/sobel(u8).{n}"]),
            (f"dog.{{}}.{T}", ["opencv", f"imageproc/dog(2 gaussian_blur_f32).{n}"]),
            (f"bilateral9.{{}}.{T}", ["opencv", f"imageproc/bilateral9(u8).{n}"]))}),
    "10": (
        [c("modal512", *BANK, "-mprefer-vector-width=512", "-DV=16"), c("modal256", *BANK, "-DV=8"),
         c("stk", "c/stk_modes.cpp", "-ffast-math", "-I/usr/include/stk", "-lstk", "-lstdc++"), rust("dsp", "modes")],
        {**{f"modes.{n}": [f"hand-C-f32x{v}/{m}.{n}" for v in (8, 16) for m in ("direct", "coupled")]
            + [f"fundsp-resonator_hz/modes.{k}", f"stk-BiQuad/modes.{n}"] for n, k in zip(BANKS, ("64", "1024", "9984"))},
         **{f"frames-hop512.{n}": [f"hand-C-f32x{v}/frames-hop512(no-fft).{n}" for v in (8, 16)] for n in BANKS}}),
    "11": (
        [rust("dsp", "fft"), *python("item11_ifft.py", "scipy-pocketfft", "mkl_fft", "pyfftw"),
         c("fft", "c/fft_bound.c", "-lfftw3f", "-lm")],
        {f"{m}.{n}.f32.{T}": [f"{p}/irfft.{k}.f32.{t}" for p, t in (
            ("realfft", "1t"), ("scipy-pocketfft", T), ("mkl_fft", T), ("pyfftw", "1t"), ("fftw3f-C", "1t"))]
         for m in ("clip", "clip-fixed") for n, k in ((2048, 2048), (2206, 2205), (4096, 4096))}),
    "12": (
        [rust("geo", "contact"), *python("item12_contact.py", "libigl", "open3d(embree)", "ipctk", "warp-cpu")],
        {"body.refit+closest-point": ["parry3d", "warp-cpu", "open3d(embree)/body.build+closest-point", "libigl/body.closest-point"],
         "body.closest-point-only": ["parry3d", "open3d(embree)"],
         "body.build-bvh": ["parry3d"],
         "body.refit": ["parry3d"],
         "self.refit+vertex-triangle-pairs": [
             "parry3d", *(f"ipctk-{n}/self.broad+narrow(ee+fv)" for n in ("BVH", "LBVH", "HashGrid", "SpatialHash", "SweepAndPrune"))]}),
    "13": (
        [rust("graph", name) for name in ("floor", "fundsp", "dasp", "knyst", "firewheel", "webaudio")],
        {m: ["floor:dyn-call-loop", "fundsp-Net", "dasp_graph", "knyst", "firewheel", "web-audio-api(quantum128)"]
         for m in ("chain.100", "fan.1000")}),
    "14": (
        python("item14_modal.py", "scipy-superlu", "pypardiso-MKL", "cholespy-CHOLMOD"),
        {f"eigsh100.{n}": ["scipy-superlu", "pypardiso-MKL", "cholespy-CHOLMOD"] for n in ("2k", "30k")}),
}
# Writes the meshes of item 14 for foley, as Gmsh 4.1 text.
MESHES = r"""
import os, sys
folder = sys.argv.pop()
import common
common.main = lambda *a: None
import item14_modal as m
for name, h in m.SIZES.items():
    P, T = m.mesh(h)
    n, k = len(P), len(T)
    with open(os.path.join(folder, name + ".msh"), "w") as f:
        print(f"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {n} 1 {n}\n3 1 0 {n}", *range(1, n + 1), sep="\n", file=f)
        for p in P: print(*(repr(float(x)) for x in p), file=f)
        print(f"$EndNodes\n$Elements\n1 {k} 1 {k}\n3 1 4 {k}", file=f)
        for i, t in enumerate(T, 1): print(i, *(int(v) + 1 for v in t), file=f)
        print("$EndElements", file=f)
"""


def say(text):
    print(f"# {text}", flush=True)


def figures(command, folder=None):
    """The printed figures of a command: {(program, metric): (value, unit)}; or the reason why there are none."""
    try:
        run = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    except OSError as error:
        return {}, error.strerror
    found = {}
    for line in run.stdout.splitlines():
        fields = line.split("\t")
        if len(fields) == 5:
            try:
                found[fields[1], fields[2]] = float(fields[3]), fields[4]
            except ValueError:
                pass
    lines = run.stderr.strip().splitlines() or [f"exit code {run.returncode}"]
    reason = next((line for line in lines if "error:" in line), lines[-1])
    return found, reason[:160] if run.returncode else None


def prepare(command):
    """The command of a program with its folder, once it is built; or the reason why it cannot be run."""
    if command[0] != "cc":
        is_python = command[0].endswith("python")
        where = "PEERS_VENV" if is_python else "PEERS_BUILD"
        return command, PEERS / "py" if is_python else None, None if Path(command[0]).exists() else f"not in {where}"
    BUILD.mkdir(parents=True, exist_ok=True)
    _, name, source, *flags = command
    compiler = ["g++" if source.endswith("pp") else "gcc", "-O3", "-march=native", str(PEERS / source), "-o", str(BUILD / name)]
    _, problem = figures(compiler + flags)
    return [str(BUILD / name)], None, f"does not build: {problem}" if problem else None


def value(found, program, metric):
    return found.get((program, metric + ".cpu")) or found.get((program, metric))


def spread(values):
    return f"{statistics.median(values):.4g}\t{min(values):.4g}..{max(values):.4g}"


def compare(item, meshes):
    commands, metrics = ITEMS[item]
    ready = []
    for command in commands:
        command, folder, problem = prepare(command)
        if problem:
            say(f"{item}: {' '.join(Path(part).name for part in command[-2:])} is missing: {problem}")
        else:
            ready.append((command, folder))
    rounds, reported = [], set()
    foley = [os.environ["FOLEY_BENCH"], "--bench", "peers", item]
    if item == "14" and meshes:
        os.environ["PEERS_MESHES"] = meshes
    for _ in range(ROUNDS):
        found, problem = figures(foley)
        if problem:
            say(f"{item}: foley failed: {problem}")
        for command, folder in ready:
            others, problem = figures(command, folder)
            found |= others
            if (problem or not others) and command[-1] not in reported:
                reported.add(command[-1])
                say(f"{item}: {command[-1]} is missing: {problem or 'it prints no figures'}")
        rounds.append(found)
    for metric, programs in metrics.items():
        own = [value(found, "foley", metric) for found in rounds]
        if None in own:
            say(f"{item}: foley has no figure for {metric}")
            continue
        unit = own[0][1]
        own = [x for x, _ in own]
        is_bound = lambda entry: entry.partition("/")[0] in BOUNDS
        for bound in (False, True):
            group = [entry for entry in programs if is_bound(entry) == bound]
            if group:
                print_line(item, metric, unit, own, group, rounds, bound)


def print_line(item, metric, unit, own, programs, rounds, bound):
    """A line of the table: figures of foley beside the best of some programs."""
    is_rate, best = unit.endswith("/s"), None
    for entry in programs:
        program, _, name = entry.partition("/")
        name = name or metric
        theirs = [value(found, program, name) for found in rounds]
        if None in theirs:
            continue
        theirs = [x for x, _ in theirs]
        middle = statistics.median(theirs)
        if best is None or (middle > best[0] if is_rate else middle < best[0]):
            best = middle, program if name == metric else f"{program} {name}", theirs
    start = f"{item}\t{metric}\t{unit}\t{'more' if is_rate else 'less'}\t{spread(own)}"
    if best is None:
        print(f"{start}\t-\t-\t-\t-\t-", flush=True)
        return
    _, program, theirs = best
    ratios = spread([a / b for a, b in zip(own, theirs)])
    print(f"{start}\t{'bound: ' if bound else ''}{program}\t{spread(theirs)}\t{ratios}", flush=True)


def main():
    wanted = sys.argv[1:] or list(ITEMS)
    if unknown := [item for item in wanted if item not in ITEMS]:
        sys.exit(f"compare.py: there is no item {unknown[0]}; items are {', '.join(ITEMS)}")
    say(f"{ROUNDS} rounds, {os.environ.get('PEERS_THREADS', '1')} thread(s), load {' '.join(map('{:.2f}'.format, os.getloadavg()))}")
    print("item\tmetric\tunit\tbetter\tfoley\tspread\tbest program\tits figure\tspread\tfoley / program\tspread", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        meshes = None
        if "14" in wanted:
            _, problem = figures([str(VENV / "bin/python"), "-c", MESHES, folder], PEERS / "py")
            meshes = None if problem else folder
            if problem:
                say(f"14: the meshes of the other programs are missing, foley has its own: {problem}")
        for item in wanted:
            compare(item, meshes)


main()
