#include "transport/path.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "transport/bake_point.h"

namespace weft::transport {

namespace {
constexpr float kFar = std::numeric_limits<float>::infinity();
}  // namespace

Path::Path(const Scene& scene, std::span<const shading::FibreBcsdf> materials,
           std::uint32_t segment, glm::vec3 direction)
    : scene_(scene), materials_(materials), direction_(direction) {
  const BakePoint start = bake_point(scene, segment);
  position_mm_ = start.position_mm;
  own_ = start.own;
}

bool Path::advance() {
  const auto hit = scene_.closest(position_mm_, direction_, kFar, own_);
  if (!hit) {
    return false;
  }
  travelled_mm_ += static_cast<double>(hit->t_mm) * glm::dvec2(direction_);
  const fabric::Tile& tile = scene_.tile();
  const glm::ivec2 from = scene_.tile_of(position_mm_);
  const glm::vec3 reached = position_mm_ + hit->t_mm * direction_;
  const glm::ivec2 into = scene_.tile_of(reached);
  position_mm_ = reached - glm::vec3(static_cast<float>(into.x) * tile.size_mm.x,
                                     static_cast<float>(into.y) * tile.size_mm.y, 0);
  // Rounding may leave the point just outside the tile it was moved to; names follow the point.
  own_ = scene_.seen_from(hit->copy, into - from + scene_.tile_of(position_mm_));

  const fabric::Segment segment = tile.segment(hit->segment);
  frame_ = shading::fibre_frame(glm::normalize(segment.b_mm - segment.a_mm), -direction_);
  omega_o_ = frame_ * -direction_;
  material_ = tile.strands[tile.segment_strand[hit->segment]].material;
  bcsdf_ = &materials_[material_];
  ++vertices_;
  return true;
}

void Path::count(bool reflects, glm::vec3 omega_i) {
  if (material_ >= counts_.of.size()) {
    return;
  }
  PathCounts::Material& of = counts_.of[material_];
  if (!reflects) {
    ++of.transmissions;
    return;
  }
  ++of.reflections;
  const float cos_theta = std::sqrt(omega_i.y * omega_i.y + omega_i.z * omega_i.z);
  const float grazing = shading::schlick_weight(cos_theta);
  const glm::vec3 coloured = bcsdf_->material().c_r * (1 - grazing);
  for (int c = 0; c < 3; ++c) {
    of.coloured[c] += coloured[c] > 0 ? coloured[c] / (coloured[c] + grazing) : 0;
  }
}

bool Path::go_on(const shading::LobeOdds& odds, glm::vec3 u) {
  const shading::BcsdfStep step = bcsdf_->scatter(omega_o_, odds, throughput_, u);
  if (step.survives) {
    direction_ = glm::normalize(glm::transpose(frame_) * step.omega_i);
    throughput_ = step.throughput;
    count(u.x < odds.r, step.omega_i);
  }
  return step.survives;
}

bool Path::scatter(core::Random& random) {
  const shading::LobeOdds odds = bcsdf_->odds(omega_o_, throughput_).at_most(1);
  const float u_lobe = random.uniform();
  const float u_theta = random.uniform();
  return go_on(odds, {u_lobe, u_theta, random.uniform()});
}

bool Path::scatter(glm::vec3 u, float worth, core::Random& random, std::vector<Path>& others) {
  shading::LobeOdds odds = bcsdf_->odds(omega_o_, throughput_);
  odds.r *= worth;
  odds.tt *= worth;
  odds = odds.at_most(static_cast<float>(kMostOthers + 1 - std::min(kMostOthers, others.size())));
  // One number picks all, evenly spaced: neither lobe has more or fewer than it should by one.
  for (float u_lobe = u.x + 1; u_lobe < odds.r + odds.tt; u_lobe += 1) {
    const float u_theta = random.uniform();
    Path other = *this;
    if (other.go_on(odds, {u_lobe, u_theta, random.uniform()})) {
      others.push_back(other);
    }
  }
  return go_on(odds, u);
}

glm::vec3 Path::reflected(glm::vec3 towards_light) const {
  // Not occluded(): transport does not see the exit of a fibre that overlaps the one it is on.
  if (scene_.closest(position_mm_, towards_light, kFar, own_)) {
    return {0, 0, 0};
  }
  return bcsdf_->evaluate_cos(frame_ * towards_light, omega_o_);
}

}  // namespace weft::transport
