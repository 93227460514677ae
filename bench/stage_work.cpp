#include "bench/stage_work.h"

#include <cmath>

// The text of the kernels over arrays that count what is read of them. The operations that follow
// each read were counted by hand in that text.
namespace weft::bench {

struct CountingGeometry {
  GeometryView view;
  Work* work;
};

namespace {

template <typename T>
T counted(const CountingGeometry* g, std::span<const T> from, std::size_t index,
          double operations) {
  g->work->bytes += sizeof(T);
  g->work->operations += operations;
  return from[index];
}

}  // namespace
}  // namespace weft::bench

namespace weft::shading {

using std::fma;

using Geometry = const bench::CountingGeometry*;

namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

DeviceCloth cloth_at(Geometry g, int index) {
  return bench::counted(g, g->view.cloths, at(index), 30);
}
DeviceTetrahedron tetrahedron_at(Geometry g, int index) {
  return bench::counted(g, g->view.tetrahedra, at(index), 30);
}
DeviceShellTriangle shell_triangle_at(Geometry g, int index) {
  return bench::counted(g, g->view.shell_triangles, at(index), 30);
}
DeviceNode node_at(Geometry g, int index) {
  return bench::counted(g, g->view.nodes, at(index), 26);
}
DeviceOuterFace outer_face_at(Geometry g, int index) {
  return bench::counted(g, g->view.outer_faces, at(index), 54);
}
DeviceFabric fabric_at(Geometry g, int index) {
  return bench::counted(g, g->view.fabrics, at(index), 60);
}
int brick_at(Geometry g, int index) { return bench::counted(g, g->view.bricks, at(index), 24); }
uint voxel_at(Geometry g, int index) { return bench::counted(g, g->view.voxels, at(index), 12); }
uint entry_at(Geometry g, uint index) { return bench::counted(g, g->view.entries, index, 2); }
DeviceCapsule capsule_at(Geometry g, int index) {
  return bench::counted(g, g->view.capsules, at(index), 50);
}
int segment_at(Geometry g, int index) {
  return static_cast<int>(bench::counted(g, g->view.segments, at(index), 0));
}
int pattern_at(Geometry g, int index) { return bench::counted(g, g->view.patterns, at(index), 12); }
int nearest_at(Geometry /*g*/, int /*index*/) { return -1; }  // the exact search is measured

}  // namespace
}  // namespace weft::shading

#include "render/kernels/eye_ray.h"

namespace weft::bench {
namespace {

Work mean(Work sum, std::size_t count) {
  const double n = count > 0 ? static_cast<double>(count) : 1;
  return {sum.bytes / n, sum.operations / n};
}

}  // namespace

Work eye_ray_work(const GeometryView& geometry, std::span<const WorldRay> rays) {
  Work sum;
  const CountingGeometry counting{geometry, &sum};
  const int cloths = static_cast<int>(geometry.cloths.size());
  for (const WorldRay& ray : rays) {
    const shading::EyeRay eye{ray.origin_mm, ray.direction};
    shading::EyeProgress progress = shading::eye_begin(eye);
    while (progress.search.cloth < cloths) {
      progress = shading::eye_on(&counting, cloths, eye, progress, 0);
    }
    sum.bytes += sizeof(shading::DeviceHit) + sizeof(shading::EyeSearch);
    sum.operations += 150;  // the random place in the pixel and the ray through it
  }
  return mean(sum, rays.size());
}

Work shadow_ray_work(const GeometryView& geometry, std::span<const shading::DeviceHit> hits,
                     glm::vec3 to_light) {
  Work sum;
  const CountingGeometry counting{geometry, &sum};
  const int cloths = static_cast<int>(geometry.cloths.size());
  std::size_t count = 0;
  for (const shading::DeviceHit& hit : hits) {
    if (hit.fate != shading::kHitFibre) {
      continue;
    }
    ++count;
    const shading::TopPoint top =
        shading::top_point(&counting, hit.cloth, hit.place, hit.flat_mm, {0, 0});
    const glm::vec3 from_mm = top.exists ? top.world_mm : hit.world_mm;
    (void)shading::blocked_by_cloth(&counting, cloths, from_mm, to_light, shading::kFarMm);
    sum.bytes += sizeof(std::uint32_t);
    sum.bytes += sizeof(shading::DeviceHit);
  }
  return mean(sum, count);
}

}  // namespace weft::bench
