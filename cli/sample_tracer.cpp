#include "cli/sample_tracer.h"

#include <algorithm>
#include <atomic>
#include <string>
#include <thread>

#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/random.h"
#include "proto/weft/v1/task.pb.h"
#include "render/fabric.h"

namespace weft::cli {

namespace {

// How the grid's stage weighed segments. The text came with the file.
v1::GridSpec grid_spec_of(const std::string& stages_json) {
  constexpr int kDeepest = 16;
  constexpr std::uint32_t kMostRays = 1024;
  using Json = nlohmann::json;
  const auto is_shallow = [](int depth, Json::parse_event_t, Json&) { return depth <= kDeepest; };
  const Json json = Json::parse(stages_json, is_shallow, false);
  const bool has_stages =
      json.is_object() && json.contains("stages") && json.at("stages").is_array();
  for (const Json& stage : has_stages ? json.at("stages") : Json::array()) {
    if (!stage.is_object() || !stage.contains("name") || stage.at("name") != "grid" ||
        !stage.contains("spec")) {
      continue;
    }
    v1::TaskSpec spec;
    const bool is_spec =
        google::protobuf::util::JsonStringToMessage(stage.at("spec").dump(), &spec).ok();
    if (is_spec && spec.grid().seen_rays_per_segment() >= 1 &&
        spec.grid().seen_rays_per_segment() <= kMostRays) {
      return spec.grid();
    }
  }
  throw core::Error(core::Code::kDataLoss,
                    "dataset /provenance/stages does not say how the grid was made; make the "
                    "fabric again");
}

}  // namespace

SampleTracer::SampleTracer(const storage::FabricDatabase& database,
                           const v1::FabricDescription& description, unsigned threads)
    : tile_(std::make_unique<const fabric::Tile>(render::tile_of(database))),
      scene_(std::make_unique<const transport::Scene>(*tile_)),
      threads_(threads) {
  const v1::GridSpec grid = grid_spec_of(database.stages_json);
  segments_ = transport::segments_by_cell(
      database.cell_of_segment, database.cell_paths.size(),
      transport::seen_segments(*scene_, grid.seen_rays_per_segment(), grid.seed()));
  settings_.sh_order = database.sh_order;
  settings_.seed = description.seed();
  settings_.max_path_length = description.precompute().max_path_length();
}

TracedSample SampleTracer::trace(const std::vector<shading::FibreBcsdf>& materials,
                                 const SamplePlan& plan) const {
  TracedSample sample;
  const std::size_t count = std::min(plan.count, segments_.size());
  for (std::size_t i = 0; i < count; ++i) {
    const double at = (static_cast<double>(i) + plan.share) / static_cast<double>(count);
    sample.cells.push_back(
        std::min(segments_.size() - 1,
                 static_cast<std::size_t>(at * static_cast<double>(segments_.size()))));
  }
  sample.sums.resize(count);
  transport::TransferSettings settings = settings_;
  settings.seed = core::derive_seed(settings_.seed, plan.purpose);
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      const std::size_t cell = sample.cells[i];
      sample.sums[i] = transport::transfer_sums(
          *scene_, materials,
          {static_cast<std::uint32_t>(cell), &segments_[cell], 0, plan.paths_per_cell}, settings);
    }
  };
  {
    std::vector<std::jthread> others;
    for (unsigned i = 1; i < threads_; ++i) {
      others.emplace_back(work);
    }
    work();
  }
  return sample;
}

std::vector<std::size_t> yarns_of_cells(const storage::FabricDatabase& database,
                                        const fabric::Tile& tile) {
  const std::size_t yarns = database.yarn_names.size();
  std::vector<std::size_t> segments(database.cell_paths.size() * yarns);
  for (std::size_t i = 0; i < tile.segment_strand.size(); ++i) {
    const fabric::Thread& thread = tile.threads[tile.strands[tile.segment_strand[i]].thread];
    ++segments[database.cell_of_segment[i] * yarns + thread.yarn];
  }
  std::vector<std::size_t> result;
  for (auto first = segments.begin(); first != segments.end();
       first += static_cast<std::ptrdiff_t>(yarns)) {
    const auto last = first + static_cast<std::ptrdiff_t>(yarns);
    result.push_back(static_cast<std::size_t>(std::max_element(first, last) - first));
  }
  return result;
}

}  // namespace weft::cli
