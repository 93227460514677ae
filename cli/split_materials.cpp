#include "cli/split_materials.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include <glm/vec3.hpp>
#include <google/protobuf/util/json_util.h>

#include "cli/colour_targets.h"
#include "cli/sample_tracer.h"
#include "core/check.h"
#include "core/error.h"
#include "core/half.h"
#include "core/moments.h"
#include "shading/scattering_orders.h"

namespace weft::cli {

namespace {

using shading::kOrderBins;
using storage::FabricDatabase;

constexpr SamplePlan kPlanOfSplits{192, 1536, 0.4, 0x73706c};  // "spl"

std::string unused_name(std::string name, const FabricDatabase& database,
                        const std::vector<MaterialSplit>& splits) {
  const auto is_used = [&] {
    const std::vector<std::string>& names = database.material_names;
    return std::find(names.begin(), names.end(), name) != names.end() ||
           std::any_of(splits.begin(), splits.end(),
                       [&](const MaterialSplit& split) { return split.name == name; });
  };
  while (is_used()) {
    name += "_";
  }
  return name;
}

// Light by orders of scattering, and light times its counts, of cells of one yarn together.
struct PooledOrders {
  std::vector<double> light;   // [groups, bins, 3]
  std::vector<double> counts;  // [groups, bins, 3, counts]
};

std::vector<PooledOrders> traced_orders(const FabricDatabase& split, const SampleTracer& tracer) {
  const std::size_t materials = split.materials.size();
  const std::size_t counts = shading::order_counts(materials);
  const std::size_t rows = shading::order_groups(materials) * kOrderBins * 3;
  const std::vector<std::size_t> yarns = yarns_of_cells(split, tracer.tile());
  std::vector<PooledOrders> pooled(split.yarn_names.size(),
                                   {std::vector<double>(rows), std::vector<double>(rows * counts)});
  const TracedSample sample =
      tracer.trace(std::vector<shading::FibreBcsdf>(split.materials.begin(), split.materials.end()),
                   kPlanOfSplits);
  for (std::size_t i = 0; i < sample.cells.size(); ++i) {
    const std::vector<std::int64_t>& numbers = sample.sums[i].order_numbers;
    CHECK_EQ(numbers.size(), rows * (1 + counts));
    PooledOrders& of_yarn = pooled[yarns[sample.cells[i]]];
    for (std::size_t row = 0; row < rows; ++row) {
      of_yarn.light[row] += core::from_fixed_point(numbers[row * (1 + counts)]);
      for (std::size_t k = 0; k < counts; ++k) {
        of_yarn.counts[row * counts + k] +=
            core::from_fixed_point(numbers[row * (1 + counts) + 1 + k]);
      }
    }
  }
  return pooled;
}

// The light of each cell, bin and channel, which stays, shared among the new groups.
void share_orders(const std::vector<PooledOrders>& pooled, const std::vector<std::size_t>& yarns,
                  std::size_t old_groups, std::size_t materials,
                  storage::Recolouring& recolouring) {
  const std::size_t groups = shading::order_groups(materials);
  const std::size_t counts = shading::order_counts(materials);
  storage::Recolouring shared;
  shared.order_shapes = recolouring.order_shapes;
  for (std::size_t cell = 0; cell < yarns.size(); ++cell) {
    const PooledOrders& of_yarn = pooled[yarns[cell]];
    for (std::size_t group = 0; group < groups; ++group) {
      for (std::size_t column = 0; column < kOrderBins * 3; ++column) {
        double light = 0;
        for (std::size_t old = 0; old < old_groups; ++old) {
          light += static_cast<double>(core::float_from_half(
              recolouring.order_light[(cell * old_groups + old) * kOrderBins * 3 + column]));
        }
        double all = 0;
        for (std::size_t other = 0; other < groups; ++other) {
          all += of_yarn.light[other * kOrderBins * 3 + column];
        }
        const std::size_t row = group * kOrderBins * 3 + column;
        // Where the sample has found nothing, all of it goes to the first group, uncounted.
        const double share = all > 0 ? of_yarn.light[row] / all : (group == 0 ? 1.0 : 0.0);
        shared.order_light.push_back(core::half_from_float(static_cast<float>(light * share)));
        for (std::size_t k = 0; k < counts; ++k) {
          const double count =
              of_yarn.light[row] > 0 ? of_yarn.counts[row * counts + k] / of_yarn.light[row] : 0;
          shared.order_counts.push_back(core::half_from_float(static_cast<float>(count)));
        }
      }
    }
  }
  recolouring = std::move(shared);
}

void split_description(const std::vector<MaterialSplit>& splits, const FabricDatabase& database,
                       v1::FabricDescription& description) {
  for (const MaterialSplit& split : splits) {
    const std::string& old = database.material_names[split.material];
    for (const v1::Material& material : description.materials()) {
      if (material.name() == old) {
        v1::Material copy = material;
        copy.set_name(split.name);
        *description.add_materials() = std::move(copy);
        break;
      }
    }
    for (v1::Yarn& yarn : *description.mutable_yarns()) {
      const bool is_in = std::any_of(split.yarns.begin(), split.yarns.end(), [&](std::size_t y) {
        return database.yarn_names[y] == yarn.name();
      });
      if (is_in && yarn.material() == old) {
        yarn.set_material(split.name);
      }
    }
  }
}

// Fibres of the new materials look as they did.
void split_database(const std::vector<MaterialSplit>& splits, FabricDatabase& database) {
  const std::size_t table = database.c_s.size() / database.materials.size();
  for (const MaterialSplit& split : splits) {
    const auto added = static_cast<std::uint32_t>(database.materials.size());
    database.materials.push_back(database.materials[split.material]);
    database.material_names.push_back(split.name);
    const auto first = static_cast<std::ptrdiff_t>(split.material * table);
    const std::vector<float> c_s(database.c_s.begin() + first,
                                 database.c_s.begin() + first + static_cast<std::ptrdiff_t>(table));
    database.c_s.insert(database.c_s.end(), c_s.begin(), c_s.end());
    for (std::size_t i = 0; i < database.strands.size(); i += 3) {
      const std::size_t yarn = database.threads[std::size_t{3} * database.strands[i + 2]];
      if (database.strands[i + 1] == split.material && split.yarns.contains(yarn)) {
        database.strands[i + 1] = added;
      }
    }
  }
}

}  // namespace

std::vector<MaterialSplit> material_splits(const std::vector<std::string>& requests,
                                           const FabricDatabase& database) {
  const std::map<std::size_t, glm::dvec3> colours = requested_colours(requests, database);
  const std::vector<std::set<std::size_t>> materials = materials_of_yarns(database);
  std::vector<MaterialSplit> splits;
  for (std::size_t m = 0; m < database.materials.size(); ++m) {
    // Yarns of the material by what they shall show; first those that keep their colour.
    std::vector<std::pair<std::optional<glm::dvec3>, std::set<std::size_t>>> parts;
    for (std::size_t yarn = 0; yarn < materials.size(); ++yarn) {
      if (!materials[yarn].contains(m)) {
        continue;
      }
      const auto asked = colours.find(yarn);
      const auto wanted =
          asked == colours.end() ? std::nullopt : std::optional<glm::dvec3>(asked->second);
      auto part = std::find_if(parts.begin(), parts.end(),
                               [&](const auto& other) { return other.first == wanted; });
      if (part == parts.end()) {
        part = parts.insert(wanted ? parts.end() : parts.begin(), {wanted, {}});
      }
      part->second.insert(yarn);
    }
    for (std::size_t part = 1; part < parts.size(); ++part) {
      const std::set<std::size_t>& yarns = parts[part].second;
      const std::string name = unused_name(
          database.material_names[m] + "_" + database.yarn_names[*yarns.begin()], database, splits);
      splits.push_back({m, yarns, name});
    }
  }
  return splits;
}

std::vector<MaterialSplit> splits_between(const FabricDatabase& base,
                                          const FabricDatabase& colourway) {
  const auto refuse_unless = [](bool condition) {
    if (!condition) {
      throw core::Error(core::Code::kDataLoss,
                        "the colourway has other fibres than the fabric that its light was carried "
                        "over from; colour that fabric instead");
    }
  };
  refuse_unless(base.strands.size() == colourway.strands.size() &&
                base.threads == colourway.threads && base.yarn_names == colourway.yarn_names &&
                base.materials.size() <= colourway.materials.size());
  std::vector<MaterialSplit> splits(colourway.materials.size() - base.materials.size());
  for (std::size_t i = 0; i < base.strands.size(); i += 3) {
    const std::size_t material = colourway.strands[i + 1];
    if (material >= base.materials.size()) {
      MaterialSplit& split = splits[material - base.materials.size()];
      refuse_unless(split.yarns.empty() || split.material == base.strands[i + 1]);
      split.material = base.strands[i + 1];
      split.name = colourway.material_names[material];
      split.yarns.insert(base.threads[std::size_t{3} * base.strands[i + 2]]);
    } else {
      refuse_unless(material == base.strands[i + 1]);
    }
  }
  return splits;
}

void split_materials(const std::vector<MaterialSplit>& splits, ColourwaySource& fabric,
                     unsigned threads) {
  if (splits.empty()) {
    return;
  }
  FabricDatabase& database = fabric.contents.database;
  const std::size_t old_materials = database.materials.size();
  split_description(splits, database, fabric.description);
  split_database(splits, database);
  if (!fabric.contents.recolouring.has_orders()) {
    return;
  }
  if (database.materials.size() > shading::kMostCountedMaterials) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "so many colours of yarns of one material would take " +
                          std::to_string(database.materials.size()) +
                          " materials, and light is carried over for " +
                          std::to_string(shading::kMostCountedMaterials) +
                          " at most; give yarns that shall have one colour one material in the "
                          "description and make the fabric again");
  }
  const SampleTracer tracer(database, fabric.description, threads);
  share_orders(traced_orders(database, tracer), yarns_of_cells(database, tracer.tile()),
               shading::order_groups(old_materials), database.materials.size(),
               fabric.contents.recolouring);
}

}  // namespace weft::cli
