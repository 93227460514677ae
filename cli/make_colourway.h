#pragma once

#include <string>
#include <vector>

#include "cli/carry_check.h"
#include "cli/colour_fit.h"
#include "cli/colour_targets.h"
#include "cli/colourway_source.h"
#include "cli/sample_tracer.h"
#include "cli/swatch_response.h"
#include "coordinator/versions/carry_over.h"

namespace weft::cli {

// What is known of a fabric for the sake of its colourways, made once for all of them.
struct ColourwayModel {
  // `base` is kept by reference. Throws core::Error(kFailedPrecondition) when it does not tell
  // orders of scattering apart.
  ColourwayModel(const ColourwaySource& base, unsigned threads);

  const ColourwaySource& base;  // whose paths it is
  unsigned threads;
  coordinator::LightCarrier carrier;
  SwatchResponse response;
  SampleTracer tracer;
};

struct ColourwayRequest {
  const ColourwaySource* source = nullptr;  // whose other yarns keep their colours
  std::vector<YarnTarget> targets;
  std::string name;            // of the new fabric
  double exposure = 1;         // of the measuring scene
  bool takes_nearest = false;  // where a colour cannot be reached
};

// The exposure at which the cloth shows 1 when all its dyes are as strong as can be, so that it is
// as bright as its weave lets it be. Three digits.
[[nodiscard]] double own_exposure(const ColourwayModel& model);

// Finds dyes with which the targets show their colours in carried-over light of these levels, times
// `correction` by target.
[[nodiscard]] ColourFit fit_colourway(const ColourwayModel& model, const ColourwayRequest& request,
                                      const coordinator::OrderLevels& levels,
                                      const std::vector<glm::dvec3>& correction);
// The levels of light in the colours that are fitted with them.
[[nodiscard]] coordinator::OrderLevels levels_of_fit(const ColourwayModel& model,
                                                     const ColourwayRequest& request);

// By how much brighter targets show than was expected, by target and channel.
using ColourRatios = std::vector<glm::dvec3>;

// Puts what the targets show in a picture of `database`, times `bias`, in the place of what the fit
// expected, and multiplies `correction` by their ratio.
void measure_fit(const ColourwayModel& model, const ColourwayRequest& request,
                 const storage::FabricDatabase& database, const ColourRatios& bias, ColourFit& fit,
                 ColourRatios& correction);

// The source's description in the colours of `fit`.
[[nodiscard]] v1::FabricDescription recolored_description(const ColourwayRequest& request,
                                                          const ColourFit& fit);

// Throws core::Error(kInvalidArgument), naming the nearest colour, when a target is kPromisedDeltaE
// or more from what was asked for, unless the nearest is wanted.
inline constexpr double kPromisedDeltaE = 1;
void check_reached(const ColourwayRequest& request, const ColourFit& fit);

// A colourway whose light is carried over.
struct CarriedColourway {
  ColourFit fit;                           // as measured in a picture of the contents
  storage::RecolourableDatabase contents;  // which say what they were carried over from
  CarryError error;
};
// Fits, carries over and measures until the colours are met, or no other dyes bring them nearer.
// What is measured counts, not what the fit expects: of few paths it knows little. `bias` is by how
// much brighter the targets would show if they were traced; empty: as bright. Throws as
// check_reached.
[[nodiscard]] CarriedColourway carry_colourway(const ColourwayModel& model,
                                               const ColourwayRequest& request,
                                               const ColourRatios& bias = {});

}  // namespace weft::cli
