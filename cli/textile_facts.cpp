#include "cli/textile_facts.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>

#include <glm/geometric.hpp>

namespace weft::cli {

namespace {

struct FibreWord {
  const char* word;  // in names of materials
  const char* type;  // of U3M's list
};

constexpr std::array<FibreWord, 27> kFibreWords = {
    {{"acetate", "Acetate"},    {"acrylic", "Acrylic"},     {"alpaca", "Alpaca"},
     {"angora", "Angora"},      {"aramid", "Aramid"},       {"cashmere", "Cashmere"},
     {"cotton", "Cotton"},      {"cupro", "Cupro"},         {"elastane", "Elastane"},
     {"hemp", "Hemp"},          {"jute", "Jute"},           {"linen", "Linen"},
     {"flax", "Linen"},         {"lycra", "Lycra"},         {"lyocell", "Lyocell"},
     {"modal", "Modal"},        {"mohair", "Mohair"},       {"nylon", "Nylon"},
     {"polyamide", "Polyamid"}, {"polyester", "Polyester"}, {"polypropylene", "Polypropylen"},
     {"ramie", "Ramie"},        {"rayon", "Rayon"},         {"viscose", "Rayon"},
     {"silk", "Silk"},          {"spandex", "Spandex"},     {"wool", "Wool"}}};

TradeWord fibre_word(const std::string& material) {
  for (std::size_t at = 0; at < material.size();) {
    const std::size_t end = std::min(material.find_first_of("_-0123456789", at), material.size());
    for (const FibreWord& known : kFibreWords) {
      if (material.compare(at, end - at, known.word) == 0) {
        return {known.type, ""};
      }
    }
    at = end + 1;
  }
  return {"other", material};
}

// The step from one pick's row to the next, when all steps are the same.
std::optional<std::uint32_t> step_of(const fabric::Draft& draft) {
  const std::uint32_t ends = draft.ends;
  for (std::uint32_t step = 0; step < ends; ++step) {
    bool all = true;
    for (std::uint32_t pick = 0; pick < draft.picks && all; ++pick) {
      for (std::uint32_t end = 0; end < ends && all; ++end) {
        all = draft.warp_up(pick, end) ==
              draft.warp_up((pick + 1) % draft.picks, (end + step) % ends);
      }
    }
    if (all) {
      return step;
    }
  }
  return std::nullopt;
}

}  // namespace

TradeWord material_type(const v1::FabricDescription& description) {
  if (description.has_weave()) {
    return {"Woven", ""};
  }
  return {description.has_yarn_curves() ? "Knit" : "unknown", ""};
}

TradeWord weave_word(const fabric::Draft& draft) {
  // The binding alone: colours and yarns repeat on their own.
  fabric::Draft binding = draft;
  binding.end_yarns.assign(binding.ends, "");
  binding.pick_yarns.assign(binding.picks, "");
  binding = fabric::minimal_repeat(binding);
  const std::uint32_t n = binding.ends;
  const std::optional<std::uint32_t> step =
      n == binding.picks && n >= 2 && n <= 64 ? step_of(binding) : std::nullopt;
  std::uint32_t up = 0;
  for (std::uint32_t end = 0; end < n; ++end) {
    up += binding.warp_up(0, end) ? 1U : 0U;
  }
  if (step && n == 2) {
    return {"Plain weave", ""};
  }
  if (step && *step == 1) {
    return {"Twill - right hand (Z)", ""};
  }
  if (step && *step == n - 1) {
    return {"Twill - left hand (S)", ""};
  }
  if (step && *step > 1 && (up == 1 || up == n - 1)) {
    return {"Satin", ""};
  }
  return {"other", "weave that repeats after " + std::to_string(n) + " ends and " +
                       std::to_string(binding.picks) + " picks"};
}

TradeWord construction(const v1::FabricDescription& description) {
  return description.has_weave() ? weave_word(fabric::draft_of(description.weave()))
                                 : TradeWord{"unknown", ""};
}

std::vector<Fibre> composition(const fabric::Tile& tile) {
  std::map<std::pair<std::string, std::string>, double> volumes;
  double all = 0;
  for (const fabric::Strand& strand : tile.strands) {
    const TradeWord word = fibre_word(tile.material_names[strand.material]);
    double length = 0;
    for (std::uint32_t p = 0; p + 1 < strand.point_count; ++p) {
      length += static_cast<double>(glm::distance(tile.points_mm[strand.first_point + p],
                                                  tile.points_mm[strand.first_point + p + 1]));
    }
    const double volume =
        length * static_cast<double>(strand.radius_mm) * static_cast<double>(strand.radius_mm);
    volumes[{word.type, word.name}] += volume;
    all += volume;
  }
  std::vector<Fibre> fibres;
  fibres.reserve(volumes.size());
  for (const auto& [word, volume] : volumes) {
    fibres.push_back({{word.first, word.second}, volume / all});
  }
  std::stable_sort(fibres.begin(), fibres.end(),
                   [](const Fibre& a, const Fibre& b) { return a.share > b.share; });
  return fibres;
}

}  // namespace weft::cli
