#pragma once

#include <string>

#include "cli/make_colourway.h"
#include "cli/recolor_report.h"
#include "security/endpoint.h"

namespace weft::cli {

// How the light of a colourway is traced, and where the database goes.
struct TraceOptions {
  security::Endpoint coordinator;  // of a published source, which has it traced
  std::string output;              // file to write; empty: only a version is made
  std::string cache;               // folder of finished work; empty: one beside the output
  std::string comment;             // kept with versions, for people
  bool takes_nearest = false;
  bool is_dry_run = false;
};

// Traces the new colours, measures them, and mends the dyes as far as carried-over light was wrong:
// three times at most, of which the nearest counts. Throws core::Error(kInvalidArgument) when the
// colours were not met and the nearest ones will not do: the file is then removed, and what was the
// latest version is that again.
[[nodiscard]] Recolored trace_colourway(const TraceOptions& options, const ColourwayModel& model,
                                        const ColourwayRequest& request);

}  // namespace weft::cli
