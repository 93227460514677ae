#include "transport/embree_scene.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <embree3/rtcore.h>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>

#include "core/error.h"
#include "transport/endless_tile.h"
#include "transport/float_mode.h"

namespace weft::transport {

namespace {

struct DeviceDeleter {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneDeleter {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using Device = std::unique_ptr<RTCDeviceTy, DeviceDeleter>;
using RayScene = std::unique_ptr<RTCSceneTy, SceneDeleter>;

void check_device(const Device& device, const char* doing) {
  const RTCError error = rtcGetDeviceError(device.get());
  if (error != RTC_ERROR_NONE) {
    throw core::Error(core::Code::kResourceExhausted,
                      std::string("Embree failed while ") + doing + " (error " +
                          std::to_string(static_cast<int>(error)) +
                          "): is there enough memory for the tile?");
  }
}

bool count_bytes(void* counter, ssize_t bytes, bool /*post*/) {
  static_cast<std::atomic<std::int64_t>*>(counter)->fetch_add(bytes);
  return true;
}

// A direction for Embree: its round curves miss their start cap when a ray runs along them within
// 2e-4 (measured with 3.13.5). Rays along a coordinate axis, the only ones that meet this in
// practice, are turned in the plane of the cloth.
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

}  // namespace

struct EmbreeScene::State {
  explicit State(const fabric::Tile& tile_in) : endless(tile_in) {}

  EndlessTile endless;
  std::atomic<std::int64_t> bytes{0};  // in use by the device, which goes after all that uses it
  Device device;
  RayScene block;  // the capsules of one block, each with its midpoint in its tile
  RayScene world;  // 3 x 3 instances of block
  std::vector<Capsule> capsules;
  const glm::vec4* ends = nullptr;  // Embree's vertices: of capsule i at 2 i and 2 i + 1

  [[nodiscard]] RayContext context_for(const std::optional<StrandCopy>& ignored) const;
  void build_block();
  void build_world();
};

namespace {

bool holds_origin(const RayContext& context, unsigned primitive, unsigned instance) {
  const unsigned row = instance / 3;
  const glm::vec3 step{(static_cast<float>(instance % 3) - 1) * context.block_size_mm.x,
                       (static_cast<float>(row) - 1) * context.block_size_mm.y, 0};
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

void EmbreeScene::State::build_block() {
  const fabric::Tile& tile = endless.tile;
  const std::size_t count = static_cast<std::size_t>(endless.copies.x) *
                            static_cast<std::size_t>(endless.copies.y) * tile.segment_count();
  capsules.reserve(count);
  RTCGeometry geometry = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE);
  auto* vertices = static_cast<glm::vec4*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, sizeof(glm::vec4), 2 * count));
  auto* indices = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, sizeof(std::uint32_t), count));
  auto* flags = static_cast<std::uint8_t*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_FLAGS, 0, RTC_FORMAT_UCHAR, sizeof(std::uint8_t), count));
  check_device(device, "allocating the fibres");
  for (int y = 0; y < endless.copies.y; ++y) {
    for (int x = 0; x < endless.copies.x; ++x) {
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
        const glm::ivec2 home = endless.tile_of_midpoint(k);
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

void EmbreeScene::State::build_world() {
  world.reset(rtcNewScene(device.get()));
  rtcSetSceneFlags(world.get(), RTC_SCENE_FLAG_ROBUST);
  for (unsigned i = 0; i < 9; ++i) {
    RTCGeometry instance = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(instance, block.get());
    const double step_x = static_cast<double>(i % 3) - 1;
    const unsigned row = i / 3;
    const double step_y = static_cast<double>(row) - 1;
    std::array<float, 12> transform{1, 0, 0, 0, 1, 0, 0, 0, 1};  // columns; the last one moves
    transform[9] = static_cast<float>(step_x * endless.block_size_mm.x);
    transform[10] = static_cast<float>(step_y * endless.block_size_mm.y);
    rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, transform.data());
    rtcCommitGeometry(instance);
    rtcAttachGeometryByID(world.get(), instance, i);
    rtcReleaseGeometry(instance);
  }
  rtcCommitScene(world.get());
  check_device(device, "repeating the tile");
}

RayContext EmbreeScene::State::context_for(const std::optional<StrandCopy>& ignored) const {
  RayContext context;
  rtcInitIntersectContext(&context.embree);
  context.capsules = &capsules;
  context.tile = &endless.tile;
  context.copies = endless.copies;
  context.ignores = ignored.has_value();
  context.ignored = ignored.value_or(StrandCopy{});
  context.ends = ends;
  context.block_size_mm = glm::vec2(endless.block_size_mm);
  return context;
}

EmbreeScene::EmbreeScene(const fabric::Tile& tile) : state_(std::make_unique<State>(tile)) {
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
  rtcSetDeviceMemoryMonitorFunction(state_->device.get(), count_bytes, &state_->bytes);
  state_->build_block();
  state_->build_world();
}

EmbreeScene::~EmbreeScene() = default;

std::size_t EmbreeScene::size_bytes() const {
  const std::int64_t embree = state_->bytes.load();
  return static_cast<std::size_t>(embree) + state_->capsules.capacity() * sizeof(Capsule);
}

std::optional<Hit> EmbreeScene::closest(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                                        const std::optional<StrandCopy>& ignored) const {
  const FlushDenormals flush;
  const glm::vec3 turned = off_axis(direction);
  RayContext context = state_->context_for(ignored);
  std::optional<Hit> found;
  state_->endless.walk(origin_mm, turned, t_max_mm,
                       [&](glm::vec3 local, float length, glm::ivec2 shift, double t) {
                         context.shift = shift;
                         RTCRayHit query{};
                         query.ray = make_ray(local, turned, length);
                         query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
                         query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
                         rtcIntersect1(state_->world.get(), &context.embree, &query);
                         if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
                           return false;
                         }
                         found = Hit{static_cast<float>(t + static_cast<double>(query.ray.tfar)),
                                     query.hit.primID % state_->endless.tile.segment_count(),
                                     copy_of_hit(context, query.hit.primID, query.hit.instID[0])};
                         return true;
                       });
  return found;
}

bool EmbreeScene::occluded(glm::vec3 origin_mm, glm::vec3 direction, float t_max_mm,
                           const std::optional<StrandCopy>& ignored) const {
  const FlushDenormals flush;
  const glm::vec3 turned = off_axis(direction);
  RayContext context = state_->context_for(ignored);
  bool blocked = false;
  state_->endless.walk(origin_mm, turned, t_max_mm,
                       [&](glm::vec3 local, float length, glm::ivec2 shift, double) {
                         context.shift = shift;
                         context.origin = local;
                         context.entry_limit_mm = length;
                         // Far enough to see the exit of a capsule that holds the origin.
                         const float t_far = std::max(length, state_->endless.longest_chord_mm);
                         RTCRay ray = make_ray(local, turned, t_far);
                         rtcOccluded1(state_->world.get(), &context.embree, &ray);
                         blocked = ray.tfar < 0;
                         return blocked;
                       });
  return blocked;
}

}  // namespace weft::transport
