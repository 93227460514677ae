#include "cli/colour_targets.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "cli/colour_text.h"
#include "core/check.h"
#include "core/error.h"
#include "core/mistakes.h"

namespace weft::cli {

namespace {

using storage::FabricDatabase;

constexpr std::uint32_t kWarpRole = 0;
constexpr std::uint32_t kWeftRole = 1;

[[noreturn]] void refuse(const std::string& what) {
  throw core::Error(core::Code::kInvalidArgument, what);
}

// The yarns of threads with this role; all of them without one.
std::set<std::size_t> yarns_of_threads(const FabricDatabase& db,
                                       std::optional<std::uint32_t> role) {
  std::set<std::size_t> yarns;
  for (std::size_t i = 0; i < db.threads.size(); i += 3) {
    if (!role || db.threads[i + 1] == *role) {
      yarns.insert(db.threads[i]);
    }
  }
  return yarns;
}

std::set<std::size_t> yarns_named(const std::string& name, const FabricDatabase& db) {
  const auto found = std::find(db.yarn_names.begin(), db.yarn_names.end(), name);
  if (found != db.yarn_names.end()) {
    return {static_cast<std::size_t>(found - db.yarn_names.begin())};
  }
  std::set<std::size_t> yarns;
  if (name == "all") {
    yarns = yarns_of_threads(db, std::nullopt);
  } else if (name == "warp" || name == "weft") {
    yarns = yarns_of_threads(db, name == "warp" ? kWarpRole : kWeftRole);
  }
  if (yarns.empty()) {
    std::vector<std::string> possible = db.yarn_names;
    possible.emplace_back("all");
    refuse("there is no yarn " + core::in_quotes(name) + core::suggestion(name, possible));
  }
  return yarns;
}

}  // namespace

std::map<std::size_t, glm::dvec3> requested_colours(const std::vector<std::string>& requests,
                                                    const FabricDatabase& db) {
  std::map<std::size_t, glm::dvec3> colours;
  for (const std::string& request : requests) {
    const std::size_t equals = request.find('=');
    if (equals == std::string::npos || equals == 0) {
      refuse("--yarn " + request + " is no request; write YARN=COLOUR, such as warp=#7a1f2b");
    }
    const glm::dvec3 colour = parse_colour(request.substr(equals + 1));
    for (const std::size_t yarn : yarns_named(request.substr(0, equals), db)) {
      if (!colours.emplace(yarn, colour).second) {
        refuse("--yarn " + request + ": yarn " + core::in_quotes(db.yarn_names[yarn]) +
               " has got a colour already; give it one");
      }
    }
  }
  return colours;
}

std::vector<std::set<std::size_t>> materials_of_yarns(const FabricDatabase& db) {
  std::vector<std::set<std::size_t>> materials(db.yarn_names.size());
  for (std::size_t i = 0; i < db.strands.size(); i += 3) {
    materials[db.threads[std::size_t{3} * db.strands[i + 2]]].insert(db.strands[i + 1]);
  }
  return materials;
}

namespace {

bool share(const std::set<std::size_t>& a, const std::set<std::size_t>& b) {
  return std::any_of(a.begin(), a.end(), [&](std::size_t m) { return b.contains(m); });
}

}  // namespace

std::vector<YarnTarget> colour_targets(const std::vector<std::string>& requests,
                                       const FabricDatabase& db) {
  std::map<std::size_t, glm::dvec3> colours = requested_colours(requests, db);
  const std::vector<std::set<std::size_t>> materials = materials_of_yarns(db);
  std::vector<YarnTarget> targets;
  while (!colours.empty()) {
    const auto [first, colour] = *colours.begin();
    YarnTarget target;
    target.linear = colour;
    std::set<std::size_t> dyed = materials[first];
    // Yarns join as long as one shares a material with those that are in.
    for (bool has_grown = true; has_grown;) {
      has_grown = false;
      for (std::size_t yarn = 0; yarn < materials.size(); ++yarn) {
        const bool is_in =
            std::find(target.yarns.begin(), target.yarns.end(), yarn) != target.yarns.end();
        if (is_in || !share(materials[yarn], dyed)) {
          continue;
        }
        const auto asked = colours.find(yarn);
        CHECK(asked != colours.end() && asked->second == colour);
        target.yarns.push_back(yarn);
        dyed.insert(materials[yarn].begin(), materials[yarn].end());
        has_grown = true;
      }
    }
    for (const std::size_t yarn : target.yarns) {
      target.label += (target.label.empty() ? "" : " and ") + db.yarn_names[yarn];
      colours.erase(yarn);
    }
    target.materials.assign(dyed.begin(), dyed.end());
    targets.push_back(std::move(target));
  }
  return targets;
}

std::vector<glm::dvec3> target_colours(const std::vector<YarnTarget>& targets,
                                       const std::vector<YarnColour>& yarns) {
  std::vector<glm::dvec3> colours;
  for (const YarnTarget& target : targets) {
    glm::dvec3 sum(0);
    double seen = 0;
    for (const std::size_t yarn : target.yarns) {
      sum += yarns[yarn].share * yarns[yarn].linear;
      seen += yarns[yarn].share;
    }
    if (!(seen > 0)) {
      throw core::Error(core::Code::kFailedPrecondition,
                        "nothing of yarn " + target.label +
                            " is seen from above, so that its colour cannot be measured; colour "
                            "the yarns that are seen");
    }
    colours.push_back(sum / seen);
  }
  return colours;
}

}  // namespace weft::cli
