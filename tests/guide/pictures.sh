#!/usr/bin/env bash
# Makes the pictures of the user guide anew: tests/guide/pictures.sh GRIDWEAVE, the path of the command.
# It needs python3 with venv and the network (Pillow makes the pictures small), and chromium, which shows a report.
set -euo pipefail
guide="$(cd "$(dirname "$0")/../../pipelines/guide" && pwd)"
command="$(realpath "${1:?give the path of the command gridweave}")"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
mkdir "$work/bin" "$work/runs" "$work/out"
ln -s "$command" "$work/bin/gridweave"
export PATH="$work/bin:$PATH" XDG_RUNTIME_DIR="$work/runs"
python3 -m venv "$work/venv"
"$work/venv/bin/pip" --quiet install pillow==13.0.0
cd "$work"

# Map files: two maps as they are, and merged.
gridweave simulate -o robots.mcap --robots 2 --seed 3 --set speed=5 --set snapshots=1 --set 'resolution=[0.1]'
gridweave merge robots.mcap --robots robot1 -o robot1.yaml
gridweave merge robots.mcap --robots robot2 -o robot2.yaml
gridweave render robot1.yaml robot2.yaml -o out/map_files.png
gridweave merge robot1.yaml robot2.yaml -o merged.yaml --picture out/map_files_merged.png

# Deformed maps: rigid, and deformed.
gridweave simulate -o deformed.mcap --robots 2 --seed 5 --set speed=5 --set drift=0.02 --set snapshots=1 --set 'resolution=[0.1]'
gridweave merge deformed.mcap -o merged.mcap --picture out/rigid.png --set elastic.enabled=false
gridweave merge deformed.mcap -o merged.mcap
gridweave render merged.mcap -o out/deformed.png --show bends

# A report.
gridweave simulate -o log.mcap --robots 2 --set speed=5 --set snapshots=8
gridweave merge log.mcap -o merged.mcap --summary summary.json
gridweave report merged.mcap -o report.html --summary summary.json
timeout 120 chromium --headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking \
    --disable-component-update --disable-sync --user-data-dir="$work/browser" --hide-scrollbars --virtual-time-budget=5000 \
    --window-size=1300,960 --screenshot="$work/out/report.png" "file://$work/report.html" 2>"$work/browser.log" \
    || { cat "$work/browser.log" >&2; exit 1; }

venv/bin/python - "$guide/pictures" <<'END'
import sys
from pathlib import Path
from PIL import Image

WIDTHS = {"rigid": 560, "deformed": 560, "map_files": 900, "map_files_merged": 640, "report": 900}
folder = Path(sys.argv[1])
folder.mkdir(exist_ok=True)
for name, width in WIDTHS.items():
    picture = Image.open(f"out/{name}.png").convert("RGB")
    small = picture.resize((width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS)
    small.quantize(96, kmeans=4, dither=Image.Dither.NONE).save(folder / f"{name}.png", optimize=True)
    size = (folder / f"{name}.png").stat().st_size
    print(f"{name}.png: {small.width} x {small.height}, {size / 1000:.0f} kB")
    if size > 60_000:
        sys.exit(f"{name}.png is larger than 60 kB")
END
