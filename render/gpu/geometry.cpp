#include "render/gpu/geometry.h"

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <variant>

#include <glm/common.hpp>
#include <glm/matrix.hpp>

#include "core/check.h"
#include "core/error.h"
#include "render/gpu/bounds_tree.h"

namespace weft::render::gpu {
namespace {

using shading::DeviceCloth;
using shading::DeviceNode;
using shading::DeviceOuterFace;
using shading::DeviceShellTriangle;
using shading::DeviceTetrahedron;

// As the scalar block layout of the kernels has them.
static_assert(sizeof(DeviceCloth) == 128 && offsetof(DeviceCloth, to_flat) == 44 &&
              offsetof(DeviceCloth, first_face) == 124);
static_assert(sizeof(DeviceTetrahedron) == 188 && offsetof(DeviceTetrahedron, normal_0) == 68 &&
              offsetof(DeviceTetrahedron, behind_0) == 132 &&
              offsetof(DeviceTetrahedron, bare) == 184);
static_assert(sizeof(DeviceShellTriangle) == 72 && offsetof(DeviceShellTriangle, across_0) == 60);
static_assert(sizeof(DeviceNode) == 32 && sizeof(DeviceOuterFace) == 44);

// Of one rounding of single precision, relative; two of them where sums are rounded too.
constexpr double kRounding = 1.2e-7;

double largest(const glm::dvec3& v) { return std::max({v.x, v.y, v.z}); }

float limited(double x) { return static_cast<float>(std::clamp(x, -1e30, 1e30)); }

void pack_flat(const FlatForm& form, DeviceCloth& cloth) {
  cloth.kind = shading::kClothFlat;
  cloth.centre_mm = glm::vec3(form.centre_mm);
  cloth.to_flat = glm::mat3(form.to_flat);
  double reach = largest(glm::abs(form.centre_mm));
  for (int axis = 0; axis < 3; ++axis) {
    cloth.low_mm[axis] = limited(form.low_mm[axis]);
    cloth.high_mm[axis] = limited(form.high_mm[axis]);
    if (std::isfinite(form.high_mm[axis])) {
      reach = std::max({reach, std::fabs(form.low_mm[axis]), std::fabs(form.high_mm[axis])});
    }
  }
  // The CPU's kContactMm, and what single precision adds to it.
  cloth.contact_mm = static_cast<float>(1e-6 + 4 * kRounding * reach);
  cloth.step_mm = static_cast<float>(1e-5 + 4 * kRounding * reach);
}

glm::vec3 relative(const glm::dvec3& point, const glm::dvec3& origin) {
  return glm::vec3(point - origin);
}

// A box around points, a little too large where rounding to single precision made it small.
void add_point(Box& box, const glm::vec3& point) {
  const glm::vec3 slack = glm::abs(point) * static_cast<float>(kRounding);
  box.low_mm = glm::min(box.low_mm, point - slack);
  box.high_mm = glm::max(box.high_mm, point + slack);
}

DeviceTetrahedron packed(const Tetrahedron& tetrahedron, const glm::dvec3& centre,
                         const glm::dvec2& unit_mm) {
  DeviceTetrahedron result{};
  const glm::dvec3& corner = tetrahedron.corners_mm[0];
  result.corner_mm = relative(corner, centre);
  result.bare = tetrahedron.bare ? 1 : 0;
  result.to_flat = glm::mat3(tetrahedron.to_flat);
  result.rotation = tetrahedron.rotation;
  const glm::dvec3 flat = tetrahedron.to_flat * corner + tetrahedron.shift_mm;
  const glm::dvec2 unit = glm::floor(glm::dvec2(flat) / unit_mm);
  result.flat_mm = glm::vec3(glm::dvec3(glm::dvec2(flat) - unit * unit_mm, flat.z));
  result.flat_unit_x = static_cast<float>(unit.x);
  result.flat_unit_y = static_cast<float>(unit.y);
  const auto normal = [&](std::size_t i) { return glm::vec3(tetrahedron.normals[i]); };
  result.normal_0 = normal(0);
  result.normal_1 = normal(1);
  result.normal_2 = normal(2);
  result.normal_3 = normal(3);
  for (int i = 0; i < 4; ++i) {
    const auto face = static_cast<std::size_t>(i);
    result.offsets_mm[i] = static_cast<float>(tetrahedron.offsets_mm[face] -
                                              glm::dot(tetrahedron.normals[face], corner));
  }
  result.behind_0 = tetrahedron.behind[0];
  result.behind_1 = tetrahedron.behind[1];
  result.behind_2 = tetrahedron.behind[2];
  result.behind_3 = tetrahedron.behind[3];
  return result;
}

DeviceShellTriangle packed(const ShellTriangle& triangle, const glm::dvec3& centre) {
  return {glm::vec2(triangle.flat_mm[0]),
          glm::vec2(triangle.flat_mm[1]),
          glm::vec2(triangle.flat_mm[2]),
          relative(triangle.top_mm[0], centre),
          relative(triangle.top_mm[1], centre),
          relative(triangle.top_mm[2], centre),
          triangle.across[0],
          triangle.across[1],
          triangle.across[2]};
}

// Appends one fabric's grid, whose indices then count from the beginning of all.
void append(GeometryArrays& arrays, const FabricGrid& grid) {
  shading::DeviceFabric fabric = grid.fabric;
  fabric.first_brick = static_cast<int>(arrays.bricks.size());
  const auto first_voxel = static_cast<std::int32_t>(arrays.voxels.size());
  const auto first_entry = static_cast<std::uint32_t>(arrays.entries.size());
  const auto first_capsule = static_cast<std::uint32_t>(arrays.capsules.size());
  for (const std::int32_t brick : grid.bricks) {
    arrays.bricks.push_back(brick < 0 ? brick : brick + first_voxel);
  }
  for (const std::uint32_t voxel : grid.voxels) {
    arrays.voxels.push_back(voxel + first_entry);
  }
  for (const std::uint32_t entry : grid.entries) {
    arrays.entries.push_back(entry + first_capsule);
  }
  arrays.capsules.insert(arrays.capsules.end(), grid.capsules.begin(), grid.capsules.end());
  arrays.segments.insert(arrays.segments.end(), grid.segments.begin(), grid.segments.end());
  arrays.fabrics.push_back(fabric);
}

class Packer {
 public:
  Packer(const GeometrySettings& settings, GridCache& cache) : settings_(settings), cache_(cache) {}

  GeometryArrays pack(std::span<const std::unique_ptr<Cloth>> cloths) {
    for (const auto& cloth : cloths) {
      add(*cloth);
    }
    return std::move(arrays_);
  }

 private:
  void add(const Cloth& cloth) {
    const ClothForm form = cloth.form();
    DeviceCloth packed_cloth{};
    packed_cloth.black_underlay = form.black_underlay ? 1 : 0;
    const glm::dvec2 unit = add_fabrics(cloth.fabrics(), packed_cloth);
    if (const auto* flat = std::get_if<FlatForm>(&form.shape)) {
      pack_flat(*flat, packed_cloth);
    } else {
      const auto& shell = std::get<ShellForm>(form.shape);
      add_shell(shell, cloth.bounds(), unit, packed_cloth);
    }
    arrays_.cloths.push_back(packed_cloth);
  }

  // Returns the unit by which the flat fabric is divided.
  glm::dvec2 add_fabrics(const ClothFabric& fabrics, DeviceCloth& cloth) {
    std::vector<std::int32_t> indices;
    for (const auto& fabric : fabrics.fabrics()) {
      indices.push_back(index_of(*fabric));
    }
    cloth.fabric = indices.front();
    glm::dvec2 unit(fabrics.fabrics().front()->tile().size_mm);
    if (const BlockPattern* pattern = fabrics.pattern()) {
      unit = pattern->block_mm;
      cloth.pattern_width = static_cast<int>(pattern->width);
      cloth.pattern_height = static_cast<int>(pattern->height);
      cloth.first_pattern = next_index(arrays_.patterns.size(), pattern->fabric.size());
      for (const std::uint32_t fabric : pattern->fabric) {
        arrays_.patterns.push_back(indices[fabric]);
      }
    }
    cloth.unit_mm = glm::vec2(unit);
    return unit;
  }

  int index_of(const Fabric& fabric) {
    const auto found = std::find(arrays_.sources.begin(), arrays_.sources.end(), &fabric);
    const auto index = found - arrays_.sources.begin();
    if (found == arrays_.sources.end()) {
      arrays_.sources.push_back(&fabric);
      append(arrays_, cache_.grid_of(fabric, settings_.grid));
      if (settings_.nearest_volume) {
        add_nearest_volume(fabric, arrays_.fabrics.back());
      }
    }
    return static_cast<int>(index);
  }

  void add_nearest_volume(const Fabric& source, shading::DeviceFabric& fabric) {
    const NearestVolume& volume =
        cache_.volume_of(source, static_cast<double>(fabric.z_low_mm),
                         static_cast<double>(fabric.z_high_mm), settings_.most_nearest_bytes);
    fabric.nearest_voxels = volume.voxels;
    fabric.first_nearest = next_index(arrays_.nearest.size(), volume.segments.size());
    arrays_.nearest.insert(arrays_.nearest.end(), volume.segments.begin(), volume.segments.end());
  }

  static int next_index(std::size_t size, std::size_t more) {
    constexpr auto kMost = static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max());
    if (size + more > kMost) {
      throw core::Error(
          core::Code::kResourceExhausted,
          "the scene has more than " + std::to_string(kMost) +
              " tetrahedra, faces, voxels or blocks; use coarser meshes or fewer fabrics");
    }
    return static_cast<int>(size);
  }

  void add_shell(const ShellForm& form, const Cloth::Bounds& bounds, const glm::dvec2& unit_mm,
                 DeviceCloth& cloth) {
    const ShellGeometry& shell = *form.geometry;
    // Rounded, so that the kernels' centre is the one that positions are relative to.
    const glm::dvec3 centre(glm::vec3(0.5 * (bounds.low_mm + bounds.high_mm)));
    const double reach = largest(bounds.high_mm - bounds.low_mm);
    cloth.kind = shading::kClothShell;
    cloth.centre_mm = glm::vec3(centre);
    cloth.contact_mm = static_cast<float>(form.contact_mm);
    cloth.step_mm = static_cast<float>(1e-5 + 4 * kRounding * reach);
    cloth.first_tetrahedron = next_index(arrays_.tetrahedra.size(), shell.tetrahedra.size());
    cloth.first_triangle = next_index(arrays_.shell_triangles.size(), shell.triangles.size());
    cloth.first_node = static_cast<int>(arrays_.nodes.size());
    cloth.first_face = next_index(arrays_.outer_faces.size(), 4 * shell.tetrahedra.size());
    for (const Tetrahedron& tetrahedron : shell.tetrahedra) {
      arrays_.tetrahedra.push_back(packed(tetrahedron, centre, unit_mm));
    }
    for (const ShellTriangle& triangle : shell.triangles) {
      arrays_.shell_triangles.push_back(packed(triangle, centre));
    }
    add_outside(shell, centre);
  }

  void add_outside(const ShellGeometry& shell, const glm::dvec3& centre) {
    std::vector<DeviceOuterFace> faces;
    std::vector<Box> boxes;
    for (std::size_t k = 0; k < shell.tetrahedra.size(); ++k) {
      const Tetrahedron& tetrahedron = shell.tetrahedra[k];
      for (std::size_t face = 0; face < 4; ++face) {
        if (tetrahedron.behind[face] >= 0) {
          continue;
        }
        std::array<glm::vec3, 3> corners{};
        for (std::size_t i = 0; i < 3; ++i) {
          corners[i] = relative(tetrahedron.corners_mm[(face + i + 1) % 4], centre);
        }
        faces.push_back(
            {corners[0], corners[1], corners[2], static_cast<int>(k), static_cast<int>(face)});
        Box box{corners[0], corners[0]};
        for (const glm::vec3& corner : corners) {
          add_point(box, corner);
        }
        boxes.push_back(box);
      }
    }
    const BoundsTree tree = build_bounds_tree(boxes);
    arrays_.nodes.insert(arrays_.nodes.end(), tree.nodes.begin(), tree.nodes.end());
    for (const std::uint32_t i : tree.order) {
      arrays_.outer_faces.push_back(faces[i]);
    }
  }

  const GeometrySettings& settings_;
  GridCache& cache_;
  GeometryArrays arrays_;
};

template <typename T>
std::uint64_t bytes_of(const std::vector<T>& values) {
  return values.size() * sizeof(T);
}

}  // namespace

std::vector<int> GeometryArrays::fabrics_of(std::size_t cloth) const {
  const DeviceCloth& piece = cloths[cloth];
  if (piece.pattern_width == 0) {
    return {piece.fabric};
  }
  const auto first = patterns.begin() + piece.first_pattern;
  std::vector<int> shown(first, first + std::ptrdiff_t{piece.pattern_width} * piece.pattern_height);
  std::sort(shown.begin(), shown.end());
  shown.erase(std::unique(shown.begin(), shown.end()), shown.end());
  return shown;
}

std::uint64_t GeometryArrays::size_bytes() const {
  return bytes_of(cloths) + bytes_of(tetrahedra) + bytes_of(shell_triangles) + bytes_of(nodes) +
         bytes_of(outer_faces) + bytes_of(fabrics) + bytes_of(bricks) + bytes_of(voxels) +
         bytes_of(entries) + bytes_of(capsules) + bytes_of(segments) + bytes_of(nearest) +
         bytes_of(patterns);
}

GeometryArrays pack_geometry(std::span<const std::unique_ptr<Cloth>> cloths,
                             const GeometrySettings& settings, GridCache* cache) {
  CHECK(!cloths.empty());
  GridCache own;
  return Packer(settings, cache != nullptr ? *cache : own).pack(cloths);
}

}  // namespace weft::render::gpu
