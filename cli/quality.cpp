#include "cli/quality.h"

#include "core/check.h"

namespace weft::cli {

void add_quality_option(CLI::App& command, std::string& quality) {
  command
      .add_option("--quality", quality,
                  "preview (seconds to minutes), paper (the paper's settings) or best; default: "
                  "what the description says, else paper")
      ->check(CLI::IsMember({"preview", "paper", "best"}));
}

v1::Quality parse_quality(const std::string& quality) {
  if (quality.empty()) {
    return v1::QUALITY_UNSPECIFIED;
  }
  if (quality == "preview") {
    return v1::QUALITY_PREVIEW;
  }
  if (quality == "paper") {
    return v1::QUALITY_PAPER;
  }
  CHECK_EQ(quality, "best");
  return v1::QUALITY_BEST;
}

}  // namespace weft::cli
