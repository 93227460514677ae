#include "transport/scene.h"

#include "core/check.h"
#include "core/error.h"
#include "transport/endless_tile.h"
#include "transport/fibre_tree.h"
#include "transport/float_mode.h"
#include "transport/ray_kernel.h"
#include "transport/wide.h"

namespace weft::transport {

struct Scene::State {
  State(const fabric::Tile& tile, bool wide_in) : endless(tile), tree(endless), wide(wide_in) {}

  EndlessTile endless;
  FibreTree tree;
  bool wide;

  // `ignored` as the leg's central block sees it.
  [[nodiscard]] std::optional<StrandCopy> named_from(const std::optional<StrandCopy>& ignored,
                                                     glm::ivec2 shift) const {
    if (!ignored) {
      return std::nullopt;
    }
    return reduced({ignored->strand, ignored->tile_x - shift.x, ignored->tile_y - shift.y},
                   endless.tile.strands[ignored->strand]);
  }
};

Scene::Scene(const fabric::Tile& tile) : Scene(tile, wide_is_available()) {}

Scene::Scene(const fabric::Tile& tile, bool wide) {
  if (tile.segment_count() == 0) {
    throw core::Error(core::Code::kInvalidArgument,
                      "the tile has no fibre: nothing can be traced in it");
  }
  state_ = std::make_unique<State>(tile, wide);
}

Scene::~Scene() = default;

const fabric::Tile& Scene::tile() const { return state_->endless.tile; }

std::size_t Scene::size_bytes() const { return state_->tree.size_bytes(); }

std::optional<Hit> Scene::closest(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                                  const std::optional<StrandCopy>& ignored) const {
  const FlushDenormals flush;
  const FibreTree& tree = state_->tree;
  std::optional<Hit> found;
  state_->endless.walk(
      origin_mm, direction, t_max_mm,
      [&](glm::vec3 local, float length, glm::ivec2 shift, double t) {
        const TreeRay ray{local, direction, length, state_->named_from(ignored, shift)};
        const TreeHit hit = state_->wide ? closest_wide(tree, ray) : closest_portable(tree, ray);
        if (hit.order == TreeHit::kNone) {
          return false;
        }
        const std::uint32_t id = hit.order / FibreTree::kBlocks;
        const StrandCopy copy = tree.copy_of(id, hit.order % FibreTree::kBlocks);
        found = Hit{static_cast<float>(t + static_cast<double>(hit.t_mm)), tree.segment_of(id),
                    reduced({copy.strand, copy.tile_x + shift.x, copy.tile_y + shift.y},
                            state_->endless.tile.strands[copy.strand])};
        return true;
      });
  return found;
}

bool Scene::occluded(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                     const std::optional<StrandCopy>& ignored) const {
  const FlushDenormals flush;
  const FibreTree& tree = state_->tree;
  bool blocked = false;
  state_->endless.walk(
      origin_mm, direction, t_max_mm, [&](glm::vec3 local, float length, glm::ivec2 shift, double) {
        const TreeRay ray{local, direction, length, state_->named_from(ignored, shift)};
        blocked = state_->wide ? occluded_wide(tree, ray) : occluded_portable(tree, ray);
        return blocked;
      });
  return blocked;
}

StrandCopy Scene::own_copy(std::uint32_t segment) const {
  const glm::ivec2 home = state_->tree.home[segment];
  const std::uint32_t strand = state_->endless.tile.segment_strand[segment];
  return reduced({strand, -home.x, -home.y}, state_->endless.tile.strands[strand]);
}

glm::ivec2 Scene::tile_of(glm::vec3 point_mm) const { return state_->endless.tile_of(point_mm); }

StrandCopy Scene::seen_from(const StrandCopy& copy, glm::ivec2 tile) const {
  return reduced({copy.strand, copy.tile_x - tile.x, copy.tile_y - tile.y},
                 state_->endless.tile.strands[copy.strand]);
}

}  // namespace weft::transport
