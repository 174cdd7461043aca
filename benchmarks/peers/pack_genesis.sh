#!/usr/bin/env bash
# Packs Genesis for a CUDA host without a network: what a rigid scene imports, without assets and without what draws.
#
#   benchmarks/peers/pack_genesis.sh [DIR=.gen]    (PYTHON: a Python with pip; 40 MB in DIR/parts/0, DIR/parts/1, some minutes)
#   source DIR/parts/0/unpack.sh                   on the host, which has Python 3.12, torch, numpy and scipy; then
#   source DIR/parts/1/unpack.sh                   each in any order, together or one after the other: the last one unpacks
#   source /tmp/genesis/settings.sh                later, once it is unpacked
#
# Unpacks into /tmp/genesis (or GENESIS_DIR) and sets GENESIS_PATH for `run.py --genesis-path`. On a host with a network
# `pip install genesis-world==1.4.5 torch` into an environment of its own serves as well (`run.py --genesis-python`).
set -euo pipefail
out=$(mkdir -p "${1:-.gen}" && cd "${1:-.gen}" && pwd)
python=${PYTHON:-python3}
PART=${PART:-21M}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Genesis itself, its compiler, MuJoCo (of the version that it reads MJCF with) and small things. What is missing of its
# requirements serves drawing and other solvers; `absent.py` puts empty modules in their place.
packages=(genesis-world==1.4.5 quadrants==1.3.3 mujoco==3.10.0 pydantic==2.14.3 pydantic-core==2.50.4 annotated-types
  typing-inspection typing_extensions psutil frozendict py-cpuinfo 'trimesh>=5,<6' 'libigl!=2.6.2' fast_simplification 'Pillow>11.0'
  colorama dill rich markdown-it-py mdurl pygments cffi pycparser)
platforms=()
for tag in manylinux_2_28 manylinux_2_27 manylinux_2_24 manylinux_2_17 manylinux2014 manylinux2010 manylinux1; do
  platforms+=(--platform "${tag}_x86_64")
done
# One at a time: without dependencies two of them may want different versions of a third.
for package in "${packages[@]}"; do
  "$python" -m pip download -q --disable-pip-version-check --no-deps --only-binary=:all: --python-version 3.12 \
    --implementation cp "${platforms[@]}" -d "$work/wheels" "$package"
done
mkdir "$work/site"
for wheel in "$work"/wheels/*.whl; do "$python" -m zipfile -e "$wheel" "$work/site"; done
(
  cd "$work/site"
  rm -rf genesis/assets/* genesis/ext/pyrender/fonts genesis/ext/LuisaRender lib64 include share setuptools* _distutils_hack \
    distutils-precedence.pth mujoco/experimental mujoco/include mujoco/_simulate* mujoco/_render_filament* \
    quadrants/_lib/runtime_rocm* quadrants/assets igl/embree
  find . -name __pycache__ -prune -exec rm -rf {} +
)
rm -rf "$out/parts"
mkdir "$out/parts"
# In parts of at most $PART, each in a folder with the script, so that each can travel by itself.
tar cf - -C "$work/site" . | xz --x86 --lzma2=preset=9e,dict=160MiB | split -b "$PART" -d -a 1 - "$work/site.tar.xz."
count=$(ls "$work"/site.tar.xz.* | wc -l)
for ((k = 0; k < count; k++)); do
  mkdir "$out/parts/$k"
  mv "$work/site.tar.xz.$k" "$out/parts/$k/"
  cat > "$out/parts/$k/unpack.sh" << UNPACK
count=$count
UNPACK
  cat >> "$out/parts/$k/unpack.sh" << 'UNPACK'
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
to=${GENESIS_DIR:-/tmp/genesis} kept=${GENESIS_PARTS:-/tmp/gen}
mkdir -p "$to" "$kept" && [ -f "$to/settings.sh" ] || cp "$here"/site.tar.xz.* "$kept"
if [ ! -f "$to/settings.sh" ] && [ "$(ls "$kept" | wc -l)" = "$count" ]; then
  cat "$kept"/site.tar.xz.* | tar xJf - -C "$to" || { echo "Genesis could not be unpacked into $to" >&2; return 1; }
  # Its compiler asks for the driver by a name that only development packages install.
  if ! ldconfig -p | grep -q 'libcuda\.so '; then
    driver=$(ldconfig -p | sed -n 's/.*libcuda\.so\.1 .*=> //p' | head -1)
    [ -n "$driver" ] || driver=$(python3 -c '
import torch
torch.cuda.init()
print(next(line.split()[-1] for line in open("/proc/self/maps") if "libcuda.so" in line))' 2> /dev/null)
    [ -n "$driver" ] && mkdir -p "$to/driver" && ln -sf "$driver" "$to/driver/libcuda.so"
  fi
  echo "export GENESIS_PATH=$to LD_LIBRARY_PATH=$to/driver:\${LD_LIBRARY_PATH:-}" > "$to/settings.sh"
  rm -r "$kept"
fi
if [ -f "$to/settings.sh" ]; then source "$to/settings.sh"; else echo "Genesis: $(ls "$kept" | wc -l) of $count parts are here"; fi
UNPACK
done
du -sh "$out"/parts/*
