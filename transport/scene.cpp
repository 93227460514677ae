#include "transport/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <embree3/rtcore.h>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>

#include "core/error.h"
#include "transport/float_mode.h"

namespace weft::transport {

namespace {

// A leg of a ray ends this many radii before the copies do, and the next one starts anew.
constexpr float kReachRadii = 20;
// A tile smaller than its thickness is copied into one of at most this many capsules.
constexpr std::uint64_t kMaxCapsules = std::uint64_t{1} << 25;

struct DeviceDeleter {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneDeleter {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using Device = std::unique_ptr<RTCDeviceTy, DeviceDeleter>;
using EmbreeScene = std::unique_ptr<RTCSceneTy, SceneDeleter>;

void check_device(const Device& device, const char* doing) {
  const RTCError error = rtcGetDeviceError(device.get());
  if (error != RTC_ERROR_NONE) {
    throw core::Error(core::Code::kResourceExhausted,
                      std::string("Embree failed while ") + doing + " (error " +
                          std::to_string(static_cast<int>(error)) +
                          "): is there enough memory for the tile?");
  }
}

// Which fibre a capsule of the scene belongs to, in tiles relative to the central instance.
struct Capsule {
  std::uint32_t strand;
  std::int32_t tile_x;
  std::int32_t tile_y;
};

// What a filter needs to know about the ray it serves.
struct RayContext {
  RTCIntersectContext embree{};  // the first member: Embree hands back its address
  const std::vector<Capsule>* capsules = nullptr;
  const fabric::Tile* tile = nullptr;
  glm::ivec2 copies{1, 1};
  glm::ivec2 shift{0, 0};  // of the central instance, in tiles from the ray's own tile
  StrandCopy ignored;
  bool ignores = false;

  // For occluded() along short distances: what lies beyond counts only if it holds the origin.
  const glm::vec4* ends = nullptr;  // of capsule i at 2 i and 2 i + 1: centre and radius
  glm::vec2 block_size_mm{0, 0};
  glm::vec3 origin{0, 0, 0};
  float entry_limit_mm = 0;
};

std::int32_t floor_divide(std::int32_t a, std::int32_t b) {
  const std::int32_t quotient = a / b;
  return quotient * b != a && ((a < 0) != (b < 0)) ? quotient - 1 : quotient;
}

StrandCopy reduced(StrandCopy copy, const fabric::Strand& strand) {
  if (strand.period_x != 0) {
    const std::int32_t n = floor_divide(copy.tile_x, strand.period_x);
    copy.tile_x -= n * strand.period_x;
    copy.tile_y -= n * strand.period_y;
  } else if (strand.period_y != 0) {
    copy.tile_y -= floor_divide(copy.tile_y, strand.period_y) * strand.period_y;
  }
  return copy;
}

// Distances along a ray between which something holds.
struct Span {
  double enter;
  double leave;
};

}  // namespace

struct Scene::State {
  explicit State(const fabric::Tile& tile_in) : tile(tile_in) {}

  const fabric::Tile& tile;
  Device device;
  EmbreeScene block;  // the capsules of `copies` tiles, each with its midpoint in its tile
  EmbreeScene world;  // 3 x 3 instances of block
  glm::ivec2 copies{1, 1};
  glm::dvec2 block_size_mm{0, 0};
  float longest_chord_mm = 0;
  float overhang_mm = 0;  // no capsule reaches further out of its midpoint's tile
  float overlap_mm = 0;   // legs of one ray overlap by this
  float z_min_mm = 0;
  float z_max_mm = 0;
  std::vector<Capsule> capsules;
  const glm::vec4* ends = nullptr;  // Embree's vertices: of capsule i at 2 i and 2 i + 1

  [[nodiscard]] RayContext context_for(const std::optional<StrandCopy>& ignored) const;
  void place_capsules();
  void build_block();
  void build_world();
  [[nodiscard]] glm::ivec2 tile_of(glm::vec3 point) const;
  [[nodiscard]] Span inside_slab(double z, double direction_z) const;
  [[nodiscard]] glm::ivec2 tile_of_midpoint(std::uint32_t segment) const;

  template <class Visit>
  void walk(glm::vec3 origin, glm::vec3 direction, float t_max, const Visit& visit) const;
};

namespace {

bool holds_origin(const RayContext& context, unsigned primitive, unsigned instance) {
  const glm::vec3 step{(static_cast<float>(instance % 3) - 1) * context.block_size_mm.x,
                       (static_cast<float>(instance / 3U) - 1) * context.block_size_mm.y, 0};
  const glm::vec4 end_a = context.ends[std::size_t{2} * primitive];
  const glm::vec3 a = glm::vec3(end_a) + step;
  const glm::vec3 axis = glm::vec3(context.ends[std::size_t{2} * primitive + 1]) + step - a;
  const float length_squared = glm::dot(axis, axis);
  const float along =
      length_squared > 0 ? glm::dot(context.origin - a, axis) / length_squared : 0.0f;
  const glm::vec3 off = context.origin - (a + std::clamp(along, 0.0f, 1.0f) * axis);
  return glm::dot(off, off) < end_a.w * end_a.w;
}

StrandCopy copy_of_hit(const RayContext& context, unsigned primitive, unsigned instance) {
  const Capsule& capsule = (*context.capsules)[primitive];
  const int step_x = static_cast<int>(instance % 3) - 1;
  const int step_y = static_cast<int>(instance / 3) - 1;
  return reduced({capsule.strand, capsule.tile_x + step_x * context.copies.x + context.shift.x,
                  capsule.tile_y + step_y * context.copies.y + context.shift.y},
                 context.tile->strands[capsule.strand]);
}

bool is_ignored(const RTCFilterFunctionNArguments* arguments, const RayContext& context) {
  if (!context.ignores) {
    return false;
  }
  const unsigned primitive = RTCHitN_primID(arguments->hit, 1, 0);
  return (*context.capsules)[primitive].strand == context.ignored.strand &&
         copy_of_hit(context, primitive, RTCHitN_instID(arguments->hit, 1, 0, 0)) ==
             context.ignored;
}

bool is_exit(const RTCFilterFunctionNArguments* arguments) {
  RTCRayN* ray = arguments->ray;
  RTCHitN* hit = arguments->hit;
  return RTCHitN_Ng_x(hit, 1, 0) * RTCRayN_dir_x(ray, 1, 0) +
             RTCHitN_Ng_y(hit, 1, 0) * RTCRayN_dir_y(ray, 1, 0) +
             RTCHitN_Ng_z(hit, 1, 0) * RTCRayN_dir_z(ray, 1, 0) >
         0;
}

void keep_foreign_entries(const RTCFilterFunctionNArguments* arguments) {
  const auto& context = *reinterpret_cast<const RayContext*>(arguments->context);
  if (is_exit(arguments) || is_ignored(arguments, context)) {
    arguments->valid[0] = 0;
  }
}

void keep_foreign_overlaps(const RTCFilterFunctionNArguments* arguments) {
  const auto& context = *reinterpret_cast<const RayContext*>(arguments->context);
  const bool too_far = RTCRayN_tfar(arguments->ray, 1, 0) > context.entry_limit_mm;
  if (is_ignored(arguments, context) ||
      (too_far && !holds_origin(context, RTCHitN_primID(arguments->hit, 1, 0),
                                RTCHitN_instID(arguments->hit, 1, 0, 0)))) {
    arguments->valid[0] = 0;
  }
}

// Embree's round curves miss their start cap when a ray runs along them within 2e-4 (measured with
// 3.13.5). Rays along a coordinate axis, the only ones that meet this in practice, are turned in
// the plane of the cloth.
glm::vec3 off_axis(glm::vec3 direction) {
  constexpr float kTilt = 4e-4f;
  if (direction.y == 0 && (direction.x == 0 || direction.z == 0)) {
    direction.y = kTilt;
  } else if (direction.x == 0 && direction.z == 0) {
    direction.x = kTilt;
  } else {
    return direction;
  }
  return glm::normalize(direction);
}

RTCRay make_ray(glm::vec3 origin, glm::vec3 direction, float t_far) {
  RTCRay ray{};
  ray.org_x = origin.x;
  ray.org_y = origin.y;
  ray.org_z = origin.z;
  ray.dir_x = direction.x;
  ray.dir_y = direction.y;
  ray.dir_z = direction.z;
  ray.tnear = 0;
  ray.tfar = t_far;
  ray.mask = ~0u;
  return ray;
}

}  // namespace

glm::ivec2 Scene::State::tile_of_midpoint(std::uint32_t segment) const {
  const fabric::Segment s = tile.segment(segment);
  const glm::vec3 middle = 0.5f * (s.a_mm + s.b_mm);
  const glm::vec3 wrapped = tile.wrapped_midpoint(segment);
  return {static_cast<int>(std::lround((middle.x - wrapped.x) / tile.size_mm.x)),
          static_cast<int>(std::lround((middle.y - wrapped.y) / tile.size_mm.y))};
}

// Chooses how many tiles make a block: one that a ray crosses in few legs.
void Scene::State::place_capsules() {
  float max_radius = 0;
  float min_radius = std::numeric_limits<float>::max();
  z_min_mm = std::numeric_limits<float>::max();
  z_max_mm = -z_min_mm;
  for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
    const fabric::Segment s = tile.segment(k);
    const glm::vec3 half = 0.5f * (s.b_mm - s.a_mm);
    overhang_mm =
        std::max({overhang_mm, std::abs(half.x) + s.radius_mm, std::abs(half.y) + s.radius_mm});
    longest_chord_mm = std::max(longest_chord_mm, 2.001f * (glm::length(half) + s.radius_mm));
    max_radius = std::max(max_radius, s.radius_mm);
    min_radius = std::min(min_radius, s.radius_mm);
    z_min_mm = std::min(z_min_mm, std::min(s.a_mm.z, s.b_mm.z) - s.radius_mm);
    z_max_mm = std::max(z_max_mm, std::max(s.a_mm.z, s.b_mm.z) + s.radius_mm);
  }
  overlap_mm = 1e-3f * min_radius;
  overhang_mm *= 1.0001f;
  const float reach = overhang_mm + std::max(z_max_mm - z_min_mm, kReachRadii * max_radius);
  std::array<double, 2> needed{};
  for (int axis = 0; axis < 2; ++axis) {
    needed[static_cast<std::size_t>(axis)] =
        std::max(1.0, std::ceil(static_cast<double>(reach) / tile.size_mm[axis]));
  }
  if (!(needed[0] * needed[1] * tile.segment_count() <= static_cast<double>(kMaxCapsules))) {
    throw core::Error(core::Code::kInvalidArgument,
                      "the tile is too small for its fibres: their segments reach over " +
                          std::to_string(needed[0]) + " x " + std::to_string(needed[1]) +
                          " tiles; use shorter segments or more repeats");
  }
  copies = {static_cast<int>(needed[0]), static_cast<int>(needed[1])};
  block_size_mm = {needed[0] * tile.size_mm.x, needed[1] * tile.size_mm.y};
}

void Scene::State::build_block() {
  const std::size_t count = static_cast<std::size_t>(copies.x) *
                            static_cast<std::size_t>(copies.y) * tile.segment_count();
  capsules.reserve(count);
  RTCGeometry geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE);
  auto* vertices = static_cast<glm::vec4*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, sizeof(glm::vec4), 2 * count));
  auto* indices = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, sizeof(std::uint32_t), count));
  auto* flags = static_cast<std::uint8_t*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_FLAGS, 0, RTC_FORMAT_UCHAR, sizeof(std::uint8_t), count));
  check_device(device, "allocating the fibres");
  for (int y = 0; y < copies.y; ++y) {
    for (int x = 0; x < copies.x; ++x) {
      const glm::vec3 corner{static_cast<float>(x) * tile.size_mm.x,
                             static_cast<float>(y) * tile.size_mm.y, 0};
      for (std::uint32_t k = 0; k < tile.segment_count(); ++k) {
        const std::size_t i = capsules.size();
        const fabric::Segment s = tile.segment(k);
        const glm::vec3 middle = tile.wrapped_midpoint(k) + corner;
        const glm::vec3 half = 0.5f * (s.b_mm - s.a_mm);
        vertices[2 * i] = glm::vec4(middle - half, s.radius_mm);
        vertices[2 * i + 1] = glm::vec4(middle + half, s.radius_mm);
        indices[i] = static_cast<std::uint32_t>(2 * i);
        flags[i] = 0;  // no neighbours: a whole capsule
        const glm::ivec2 home = tile_of_midpoint(k);
        capsules.push_back({tile.segment_strand[k], x - home.x, y - home.y});
      }
    }
  }
  ends = vertices;
  rtcSetGeometryIntersectFilterFunction(geometry, keep_foreign_entries);
  rtcSetGeometryOccludedFilterFunction(geometry, keep_foreign_overlaps);
  rtcCommitGeometry(geometry);
  block.reset(rtcNewScene(device.get()));
  rtcSetSceneFlags(block.get(), RTC_SCENE_FLAG_ROBUST);
  rtcAttachGeometry(block.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(block.get());
  check_device(device, "building the hierarchy of the fibres");
}

void Scene::State::build_world() {
  world.reset(rtcNewScene(device.get()));
  rtcSetSceneFlags(world.get(), RTC_SCENE_FLAG_ROBUST);
  for (unsigned i = 0; i < 9; ++i) {
    RTCGeometry instance = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(instance, block.get());
    const double step_x = static_cast<double>(i % 3) - 1;
    const double step_y = static_cast<double>(i / 3) - 1;
    const std::array<float, 12> transform{1,
                                          0,
                                          0,
                                          0,
                                          1,
                                          0,
                                          0,
                                          0,
                                          1,
                                          static_cast<float>(step_x * block_size_mm.x),
                                          static_cast<float>(step_y * block_size_mm.y),
                                          0};
    rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, transform.data());
    rtcCommitGeometry(instance);
    rtcAttachGeometryByID(world.get(), instance, i);
    rtcReleaseGeometry(instance);
  }
  rtcCommitScene(world.get());
  check_device(device, "repeating the tile");
}

RayContext Scene::State::context_for(const std::optional<StrandCopy>& ignored) const {
  RayContext context;
  rtcInitIntersectContext(&context.embree);
  context.capsules = &capsules;
  context.tile = &tile;
  context.copies = copies;
  context.ignores = ignored.has_value();
  context.ignored = ignored.value_or(StrandCopy{});
  context.ends = ends;
  context.block_size_mm = glm::vec2(block_size_mm);
  return context;
}

// Cuts a ray into legs that stay where the nine blocks are complete, and calls
// visit(origin in the central block, direction, length, tiles from the ray's own tile to the
// central block, distance so far) for each until it returns true.
template <class Visit>
void Scene::State::walk(glm::vec3 origin, glm::vec3 direction, float t_max,
                        const Visit& visit) const {
  const Span slab = inside_slab(origin.z, direction.z);
  const double t_start = std::max(0.0, slab.enter);
  const glm::dvec3 start = glm::dvec3(origin) + t_start * glm::dvec3(direction);
  const glm::vec3 along = off_axis(direction);
  const double t_end = std::min(static_cast<double>(t_max),
                                t_start + inside_slab(start.z, static_cast<double>(along.z)).leave);
  const glm::ivec2 own = tile_of(origin);
  double t = t_start;
  for (int leg = 0; leg < kMaxLegs && t < t_end; ++leg) {
    double length = t_end - t;
    const glm::dvec3 at = start + (t - t_start) * glm::dvec3(along);
    glm::vec3 local(at);
    glm::ivec2 shift{0, 0};
    for (int axis = 0; axis < 2; ++axis) {
      const double block_index = std::floor(at[axis] / block_size_mm[axis]);
      local[axis] = static_cast<float>(at[axis] - block_index * block_size_mm[axis]);
      shift[axis] = static_cast<int>(block_index) * copies[axis] - own[axis];
      if (along[axis] != 0) {
        const double border = along[axis] > 0
                                  ? 2 * block_size_mm[axis] - static_cast<double>(overhang_mm)
                                  : static_cast<double>(overhang_mm) - block_size_mm[axis];
        length = std::min(
            length, (border - static_cast<double>(local[axis])) / static_cast<double>(along[axis]));
      }
    }
    if (visit(local, along, static_cast<float>(length), shift, t)) {
      return;
    }
    t += length < t_end - t ? length - static_cast<double>(overlap_mm) : length;
  }
}

// Where a line lies between the bounds of all fibres; empty when it never does.
Span Scene::State::inside_slab(double z, double direction_z) const {
  const double low = static_cast<double>(z_min_mm - overlap_mm);
  const double high = static_cast<double>(z_max_mm + overlap_mm);
  constexpr double kForever = std::numeric_limits<double>::infinity();
  if (direction_z == 0) {
    return z < low || z > high ? Span{0, -kForever} : Span{-kForever, kForever};
  }
  const double to_low = (low - z) / direction_z;
  const double to_high = (high - z) / direction_z;
  return {std::min(to_low, to_high), std::max(to_low, to_high)};
}

glm::ivec2 Scene::State::tile_of(glm::vec3 point) const {
  const glm::dvec2 size(tile.size_mm);
  return {static_cast<int>(std::floor(static_cast<double>(point.x) / size.x)),
          static_cast<int>(std::floor(static_cast<double>(point.y) / size.y))};
}

Scene::Scene(const fabric::Tile& tile) : state_(std::make_unique<State>(tile)) {
  if (tile.segment_count() == 0) {
    throw core::Error(core::Code::kInvalidArgument,
                      "the tile has no fibre: nothing can be traced in it");
  }
  const FlushDenormals flush;
  // The widest instruction set is pinned: other ones change the last bits of distances.
  state_->device.reset(rtcNewDevice("isa=avx2,frequency_level=simd256,set_affinity=0"));
  if (!state_->device) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "Embree does not start on this machine: a processor with AVX2 is needed");
  }
  state_->place_capsules();
  state_->build_block();
  state_->build_world();
}

Scene::~Scene() = default;

const fabric::Tile& Scene::tile() const { return state_->tile; }

std::optional<Hit> Scene::closest(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                                  const std::optional<StrandCopy>& ignored) const {
  const FlushDenormals flush;
  RayContext context = state_->context_for(ignored);
  std::optional<Hit> found;
  state_->walk(origin_mm, direction, t_max_mm,
               [&](glm::vec3 local, glm::vec3 along, float length, glm::ivec2 shift, double t) {
                 context.shift = shift;
                 RTCRayHit query{};
                 query.ray = make_ray(local, along, length);
                 query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
                 query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
                 rtcIntersect1(state_->world.get(), &context.embree, &query);
                 if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
                   return false;
                 }
                 found = Hit{static_cast<float>(t + static_cast<double>(query.ray.tfar)),
                             query.hit.primID % state_->tile.segment_count(),
                             copy_of_hit(context, query.hit.primID, query.hit.instID[0])};
                 return true;
               });
  return found;
}

bool Scene::occluded(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                     const std::optional<StrandCopy>& ignored) const {
  const FlushDenormals flush;
  RayContext context = state_->context_for(ignored);
  bool blocked = false;
  state_->walk(origin_mm, direction, t_max_mm,
               [&](glm::vec3 local, glm::vec3 along, float length, glm::ivec2 shift, double) {
                 context.shift = shift;
                 context.origin = local;
                 context.entry_limit_mm = length;
                 // Far enough to see the exit of a capsule that holds the origin.
                 const float t_far = std::max(length, state_->longest_chord_mm);
                 RTCRay ray = make_ray(local, along, t_far);
                 rtcOccluded1(state_->world.get(), &context.embree, &ray);
                 blocked = ray.tfar < 0;
                 return blocked;
               });
  return blocked;
}

StrandCopy Scene::own_copy(std::uint32_t segment) const {
  const glm::ivec2 home = state_->tile_of_midpoint(segment);
  const std::uint32_t strand = state_->tile.segment_strand[segment];
  return reduced({strand, -home.x, -home.y}, state_->tile.strands[strand]);
}

glm::ivec2 Scene::tile_of(glm::vec3 point_mm) const { return state_->tile_of(point_mm); }

StrandCopy Scene::seen_from(const StrandCopy& copy, glm::ivec2 tile) const {
  return reduced({copy.strand, copy.tile_x - tile.x, copy.tile_y - tile.y},
                 state_->tile.strands[copy.strand]);
}

}  // namespace weft::transport
