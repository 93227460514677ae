#!/bin/sh
# Draws the pictures of docs/gallery.md into docs/gallery.
#
# Usage: docs/gallery.sh [FOLDER [WEFT]]
#   FOLDER  databases of the examples, FABRIC.h5; those that are missing are made there, with
#           --quality preview. Default: out/gallery
#   WEFT    the program. Default: build/bin/weft
# Pictures that are there and drawn from the same scene are kept; remove FOLDER/pictures for all anew.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
databases=${1:-$root/out/gallery}
weft=${2:-$root/build/bin/weft}
pictures=$databases/pictures
fabrics="silk_plain satin_4_1 satin_1_4 satin_2_3 shot_silk_a shot_silk_b gabardine fleece"

mkdir -p "$pictures" "$root/docs/gallery"
databases=$(cd "$databases" && pwd)
pictures=$databases/pictures
python=/usr/bin/python3
[ -f "$pictures/drape.obj" ] || $python "$root/examples/scenes/drape.py" "$pictures/drape.obj"
[ -f "$pictures/sky.exr" ] || $python "$root/examples/scenes/sky.py" "$pictures/sky.exr"
for fabric in $fabrics; do
  if [ ! -f "$databases/$fabric.h5" ]; then
    "$weft" run "$root/examples/$fabric.textproto" -o "$databases/$fabric.h5" --quality preview
  fi
done

# draw NAME FABRIC SIZE SAMPLES [FLAG...] < SCENE: one picture; what is there already is not drawn again.
draw() {
  name=$1 fabric=$2 size=$3 samples=$4
  shift 4
  cat > "$pictures/$name.textproto"
  "$weft" render "$databases/$fabric.h5" --scene "$pictures/$name.textproto" --size "$size" \
    --spp "$samples" -o "$pictures/$name.exr" --png "$root/docs/gallery/$name.png" --resume "$@"
}

key='lights { sg { towards { x: -0.6 y: -0.45 z: 0.75 } sharpness: 150 irradiance { r: 3 g: 3 b: 3 } } }'
fill='lights { sg { towards { x: 0.6 y: -0.5 z: 0.6 } sharpness: 4 irradiance { r: 0.5 g: 0.5 b: 0.6 } } }'
drape='cloths { black_underlay: true
  shell { obj_file: "drape.obj" texture_width_mm: 30 texture_height_mm: 30 } }'
view='camera { position { x: 12 y: -42 z: 26 } look_at { z: -1.5 } perspective { vertical_angle_deg: 30 } }'
flat='cloths { flat { endless: true } black_underlay: true }
cut_lights_at_horizon: true'

for fabric in $fabrics; do
  draw "${fabric}_draped" "$fabric" 256x256 8 << SCENE
$view $key $fill $drape
SCENE
  # Some yarns across: the fibres are seen.
  draw "${fabric}_close" "$fabric" 192x192 16 << SCENE
camera { position { x: 0.6 y: -2 z: 3 } look_at {} orthographic { height_mm: 1.5 } }
$key $fill $flat
SCENE
done

# The same satin from near by, and from so far that a pixel is several yarns.
draw satin_4_1_near satin_4_1 256x256 8 << SCENE
camera { position { x: 4 y: -14 z: 12 } look_at { y: -3 z: 5 } perspective { vertical_angle_deg: 22 } }
$key $fill $drape
SCENE
draw satin_4_1_far satin_4_1 256x256 16 << SCENE
camera { position { x: 60 y: -210 z: 130 } look_at { z: -1.5 } perspective { vertical_angle_deg: 12 } }
$key $fill $drape
SCENE

# Five lights of about the same irradiance.
draw light_directional satin_1_4 192x192 8 << SCENE
$view lights { directional { towards { x: -0.6 y: -0.45 z: 0.75 } irradiance { r: 3 g: 3 b: 3 } } } $drape
SCENE
draw light_sg_400 satin_1_4 192x192 8 << SCENE
$view lights { sg { towards { x: -0.6 y: -0.45 z: 0.75 } sharpness: 400 irradiance { r: 3 g: 3 b: 3 } } } $drape
SCENE
draw light_sg_10 satin_1_4 192x192 8 << SCENE
$view lights { sg { towards { x: -0.6 y: -0.45 z: 0.75 } sharpness: 10 irradiance { r: 3 g: 3 b: 3 } } } $drape
SCENE
draw light_point satin_1_4 192x192 8 << SCENE
$view lights { point { position { x: -14 y: -12 z: 18 } intensity { r: 2000 g: 2000 b: 2000 } } } $drape
SCENE
draw light_area satin_1_4 192x192 16 << SCENE
$view lights { area { rectangle { corner { x: -40 y: -20 z: 30 } edge_a { x: 25 z: 25 } edge_b { y: -25 } }
  radiance { r: 12 g: 12 b: 12 } } } $drape
SCENE

# A sky, drawn by directions and as spherical Gaussians that were fitted to it.
sky='lights { environment { exr_file: "sky.exr" } }'
# (A device has no other way than the second.)
draw sky_drawn shot_silk_a 256x256 16 --device cpu << SCENE
$view $sky $drape
SCENE
draw sky_fitted shot_silk_a 256x256 8 << SCENE
$view $sky $drape integration { environment_lights: 32 }
SCENE

# Patterned cloth.
pattern=$(sed -n '/^  pattern {/,/^  }/p' "$root/examples/scenes/damask.textproto" |
  sed "s|out/satin_1_4.h5|$databases/satin_1_4.h5|")
draw damask_flat satin_4_1 256x256 8 << SCENE
camera { position { x: 1 y: -6 z: 12 } look_at {} orthographic { height_mm: 8 } }
$key $fill cloths { $pattern flat { endless: true } black_underlay: true } cut_lights_at_horizon: true
SCENE
draw damask_draped satin_4_1 256x256 8 << SCENE
$view $key $fill cloths { $pattern black_underlay: true
  shell { obj_file: "drape.obj" texture_width_mm: 30 texture_height_mm: 30 } }
SCENE
