#include "render/triangle_scene.h"

#include <algorithm>
#include <string>

#include <embree3/rtcore.h>

#include "core/error.h"
#include "transport/float_mode.h"

namespace weft::render {
namespace {

struct DeviceDeleter {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneDeleter {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};

RTCRay embree_ray(const Ray& ray, double t_min_mm, double t_max_mm) {
  RTCRay result{};
  result.org_x = static_cast<float>(ray.origin_mm.x);
  result.org_y = static_cast<float>(ray.origin_mm.y);
  result.org_z = static_cast<float>(ray.origin_mm.z);
  result.dir_x = static_cast<float>(ray.direction.x);
  result.dir_y = static_cast<float>(ray.direction.y);
  result.dir_z = static_cast<float>(ray.direction.z);
  result.tnear = static_cast<float>(std::max(0.0, t_min_mm));
  result.tfar = static_cast<float>(t_max_mm);
  result.mask = ~0U;
  return result;
}

}  // namespace

struct TriangleScene::State {
  std::unique_ptr<RTCDeviceTy, DeviceDeleter> device;
  std::unique_ptr<RTCSceneTy, SceneDeleter> scene;
};

TriangleScene::TriangleScene(const std::vector<glm::vec3>& corners_mm)
    : state_(std::make_unique<State>()) {
  const transport::FlushDenormals flush;
  // The instruction set is pinned as in transport/scene.cpp.
  state_->device.reset(rtcNewDevice("isa=avx2,frequency_level=simd256,set_affinity=0"));
  if (!state_->device) {
    throw core::Error(core::Code::kFailedPrecondition,
                      "Embree does not start on this machine: a processor with AVX2 is needed");
  }
  RTCGeometry geometry = rtcNewGeometry(state_->device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
  const std::size_t corners = corners_mm.size();
  auto* vertices = static_cast<glm::vec3*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(glm::vec3), corners));
  auto* indices = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(std::uint32_t), corners / 3));
  if (vertices == nullptr || indices == nullptr) {
    rtcReleaseGeometry(geometry);
    throw core::Error(core::Code::kResourceExhausted,
                      "there is no memory for the mesh; use a coarser one");
  }
  std::copy(corners_mm.begin(), corners_mm.end(), vertices);
  for (std::size_t i = 0; i < corners; ++i) {
    indices[i] = static_cast<std::uint32_t>(i);
  }
  rtcCommitGeometry(geometry);
  state_->scene.reset(rtcNewScene(state_->device.get()));
  rtcSetSceneFlags(state_->scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcAttachGeometry(state_->scene.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(state_->scene.get());
  const RTCError error = rtcGetDeviceError(state_->device.get());
  if (error != RTC_ERROR_NONE) {
    throw core::Error(core::Code::kResourceExhausted,
                      "Embree failed while building the mesh (error " +
                          std::to_string(static_cast<int>(error)) + "); use a coarser one");
  }
}

TriangleScene::~TriangleScene() = default;

std::optional<TriangleScene::Hit> TriangleScene::closest(const Ray& ray, double t_min_mm,
                                                         double t_max_mm) const {
  const transport::FlushDenormals flush;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query{};
  query.ray = embree_ray(ray, t_min_mm, t_max_mm);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(state_->scene.get(), &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
    return std::nullopt;
  }
  return Hit{static_cast<double>(query.ray.tfar), query.hit.primID};
}

bool TriangleScene::occluded(const Ray& ray, double t_min_mm, double t_max_mm) const {
  const transport::FlushDenormals flush;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay query = embree_ray(ray, t_min_mm, t_max_mm);
  rtcOccluded1(state_->scene.get(), &context, &query);
  return query.tfar < 0;
}

}  // namespace weft::render
