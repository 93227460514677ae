#pragma once

#include "render/draw.h"

namespace weft::render {

// Puts the layers that the drawing has, of those in `wanted`, into drawing.image.channels, for
// write_exr: single.R .G .B, multiple.R .G .B, shadow.Y, segment.id and segment.cloth (whole
// numbers), tangent.X .Y .Z, normal.X .Y .Z, variance.R .G .B.
void attach_layers(Drawing& drawing, LayerSet wanted);

}  // namespace weft::render
