#pragma once

#include <string>
#include <vector>

#include "cli/carry_check.h"
#include "cli/colour_fit.h"
#include "cli/colour_targets.h"
#include "cli/colourway_source.h"
#include "cli/swatch_response.h"

namespace weft::cli {

// What colourways of one fabric are made from.
struct ColourwayRequest {
  const ColourwaySource* source = nullptr;  // whose other yarns keep their colours
  const ColourwaySource* base = nullptr;    // whose paths it is
  std::vector<YarnTarget> targets;
  std::string name;  // of the new fabric
  unsigned threads = 0;
  double exposure = 1;  // of the measuring scene
};

// The exposure at which the cloth shows 1 when all its dyes are as strong as can be, so that it is
// as bright as its weave lets it be. Three digits.
[[nodiscard]] double own_exposure(const storage::RecolourableDatabase& base,
                                  const SwatchResponse& response);

// Dyes with which the targets show their colours in carried-over light, by the response of the
// base, times `correction` by target.
[[nodiscard]] ColourFit fit_colourway(const ColourwayRequest& request,
                                      const SwatchResponse& response,
                                      const std::vector<glm::dvec3>& correction);

// Puts what the targets show in a picture of `database` in the place of what the fit expected, and
// multiplies `correction` by their ratio.
void measure_fit(const ColourwayRequest& request, const storage::FabricDatabase& database,
                 ColourFit& fit, std::vector<glm::dvec3>& correction);

// The source's description in the colours of `fit`.
[[nodiscard]] v1::FabricDescription recolored_description(const ColourwayRequest& request,
                                                          const ColourFit& fit);

// A colourway whose light is carried over.
[[nodiscard]] storage::RecolourableDatabase carried_colourway(const ColourwayRequest& request,
                                                              const ColourFit& fit);
// Finds out how far it is off, and lets it say so, and from what it was carried over.
CarryError state_origin(const ColourwayRequest& request, storage::RecolourableDatabase& colourway);

}  // namespace weft::cli
