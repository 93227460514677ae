#pragma once

#include <map>
#include <string>

#include "cli/fabric_shelf.h"
#include "cli/render_options.h"
#include "render/draw.h"

namespace weft::cli {

// How the picture was made, for its header; nothing about when or where.
[[nodiscard]] std::map<std::string, std::string> picture_metadata(const v1::Scene& described,
                                                                  const FabricShelf& shelf,
                                                                  const render::Drawing& drawing);

// Writes every file that was asked for, `layers` into the picture, `attributes` in the headers of
// those that have one. Throws core::Error(kUnavailable) when one cannot be written.
void write_pictures(const RenderOptions& options, render::LayerSet layers, render::Drawing& drawing,
                    const std::map<std::string, std::string>& attributes);

// Says on stdout what was drawn and how long it took.
void report_drawing(const RenderOptions& options, const v1::Scene& described,
                    const render::Drawing& drawing, double load_seconds, double draw_seconds);

}  // namespace weft::cli
