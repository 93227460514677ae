#include "render/gpu/device_geometry.h"

#include <array>
#include <span>
#include <string>

#include "core/error.h"

namespace weft::render::gpu {
namespace {

struct Part {
  std::span<const std::byte> bytes;
  const char* what;
};

template <typename T>
Part part(const std::vector<T>& values, const char* what) {
  return {std::as_bytes(std::span(values)), what};
}

std::string mebibytes(std::uint64_t bytes) {
  return std::to_string((bytes + (std::uint64_t{1} << 20) - 1) >> 20) + " MiB";
}

void check_room(const Device& device, const GeometryArrays& arrays, std::span<const Part> parts) {
  const DeviceInfo& info = device.info();
  for (const Part& each : parts) {
    if (each.bytes.size() > info.max_buffer_bytes) {
      throw core::Error(core::Code::kResourceExhausted,
                        std::string("the scene's ") + each.what + " take " +
                            mebibytes(each.bytes.size()) + ", and " + info.name +
                            " reads at most " + mebibytes(info.max_buffer_bytes) +
                            " at once; use coarser meshes or smaller exemplars");
    }
  }
  const std::uint64_t needed = arrays.size_bytes() + device.used_bytes();
  if (needed > info.memory_bytes) {
    throw core::Error(core::Code::kResourceExhausted,
                      "the scene's geometry takes " + mebibytes(arrays.size_bytes()) + " beside " +
                          mebibytes(device.used_bytes()) + " in use, and " + info.name + " has " +
                          mebibytes(info.memory_bytes) +
                          "; use coarser meshes or smaller exemplars");
  }
}

std::vector<const Buffer*> pointers(const std::vector<Buffer>& buffers) {
  std::vector<const Buffer*> result;
  for (const Buffer& buffer : buffers) {
    result.push_back(&buffer);
  }
  return result;
}

}  // namespace

DeviceGeometry::DeviceGeometry(Device& device, const GeometryArrays& arrays)
    : cloths_(static_cast<int>(arrays.cloths.size())) {
  const std::array<Part, 5> solid = {
      part(arrays.cloths, "pieces of cloth"), part(arrays.tetrahedra, "tetrahedra"),
      part(arrays.shell_triangles, "shell triangles"), part(arrays.nodes, "boxes of shells"),
      part(arrays.outer_faces, "outer faces of shells")};
  const std::array<Part, 8> grid = {part(arrays.fabrics, "fabrics"),
                                    part(arrays.bricks, "bricks of voxels"),
                                    part(arrays.voxels, "voxels"),
                                    part(arrays.entries, "lists of fibres in voxels"),
                                    part(arrays.capsules, "fibres"),
                                    part(arrays.segments, "numbers of segments"),
                                    part(arrays.nearest, "volumes of nearest segments"),
                                    part(arrays.patterns, "patterns")};
  check_room(device, arrays, solid);
  check_room(device, arrays, grid);
  for (const Part& each : solid) {
    solid_.push_back(device.upload(each.bytes, each.what));
  }
  for (const Part& each : grid) {
    grid_.push_back(device.upload(each.bytes, each.what));
  }
}

std::vector<const Buffer*> DeviceGeometry::solid_buffers() const { return pointers(solid_); }
std::vector<const Buffer*> DeviceGeometry::grid_buffers() const { return pointers(grid_); }

}  // namespace weft::render::gpu
