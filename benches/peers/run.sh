#!/bin/sh
# Runs foley's side of the works of `benches/peers`: each item in a process of its own, one line a figure.
#   benches/peers/run.sh [ITEM ...]    items: 01 .. 14 (default: all); figures on standard output, everything else on standard error
# Environment: PEERS_RUNS (runs, default 5), PEERS_THREADS (threads, default 1), PEERS_MESHES (folder of 2k.msh and 30k.msh for item 14)
set -eu
cd "$(dirname "$0")/../.."
cargo bench --locked -p foley --no-run >&2
cpu=$(sed -n 's/^model name[^:]*: *//p' /proc/cpuinfo 2>/dev/null | head -n 1)
load=$(cut -d' ' -f1-3 /proc/loadavg 2>/dev/null || true)
printf '# %s\t%s\tload %s\tthreads %s\truns %s\n' "$(date -u +%Y-%m-%dT%H:%M:%SZ)" "${cpu:-unknown}" "${load:-unknown}" \
  "${PEERS_THREADS:-1}" "${PEERS_RUNS:-5}"
for item in ${*:-01 02 03 04 05 06 07 08 09 10 11 12 13 14}; do
  cargo bench --locked -q -p foley -- peers "$item" || echo "run.sh: item $item failed" >&2
done
