#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cli/message_json.h"
#include "cli/progress.h"
#include "client/fetch_version.h"
#include "proto/weft/v1/cluster.pb.h"

// The coordinator's messages as people and programs read them.

namespace weft::cli {

// "queued", "running", "committing", "succeeded", "failed", "cancelled".
[[nodiscard]] std::string state_text(v1::JobState state);

// "live", "lost", "drained", "blocked for transfer, grid", or several of these.
[[nodiscard]] std::string condition_text(const v1::Worker& worker);

// "2026-11-22 09:04:05" (UTC); "-" for 0.
[[nodiscard]] std::string time_text(std::int64_t at_ms);

using client::reference_text;  // "silk@3"

// The first 12 hexadecimal digits.
[[nodiscard]] std::string short_digest(const std::string& binary_digest);

// How many of the results that it was made from had been computed before, "12/151"; "light of
// silk@1" where it has none of its own.
[[nodiscard]] std::string reused_text(const v1::Version& version);

// Shards done and in all of the stages that are known, "512/1024".
// That audits were given up, in words; empty when none was.
[[nodiscard]] std::string audits_text(const v1::Job& job);
[[nodiscard]] std::string shards_text(const v1::Job& job);

[[nodiscard]] std::vector<StageProgress> stages_of(const v1::Job& job);

}  // namespace weft::cli
