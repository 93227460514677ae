#pragma once

#include <cstdint>
#include <vector>

#include "render/fabric.h"
#include "render/gpu/device.h"
#include "render/kernels/shading_records.h"

namespace weft::render::gpu {

// The tables of a fabric as kernels read them (render/kernels/fabric_buffers.glsl and
// transfer_buffers.glsl), still in the host's memory: what their upload will take is known before.
struct FabricArrays {
  shading::DeviceFabricSizes sizes{};
  std::vector<float> floats;
  std::vector<shading::DeviceSegment> segments;
  std::vector<std::uint32_t> ssdf_basis;    // pairs of halves, [pixels, pairs]
  std::vector<std::uint32_t> ssdf_factors;  // ..., [segments, pairs]
  std::vector<std::uint32_t> gaussians;     // ..., [segments, pairs]
  // Of the transfer matrices of one cell, [3 channels, columns, quads of rows].
  std::uint64_t words_per_cell = 0;
  std::uint32_t cells = 0;
  std::vector<std::uint32_t> transfer;

  [[nodiscard]] std::uint64_t size_bytes() const;
};

// Halves hold the basis, the factors and the Gaussians' weights; the transfer matrices too, where
// rounding adds less than a tenth of their own standard error (what the database writer asks), and
// floats elsewhere. Throws core::Error(kResourceExhausted) with figures when a table is larger than
// the kernels' indices reach. REQUIRES: fabric.precomputed() is not null.
[[nodiscard]] FabricArrays pack_fabric(const Fabric& fabric);

// The tables of a fabric in the memory of a device. The transfer matrices are spread over pages of
// whole cells, each no larger than one binding may be.
class DeviceFabricTables {
 public:
  // Throws core::Error(kResourceExhausted) with figures when a table is larger than one binding may
  // be, or the memory does not suffice.
  DeviceFabricTables(Device& device, const FabricArrays& arrays);

  struct Page {
    Buffer transfer;
    std::uint32_t first_cell = 0;
    std::uint32_t cells = 0;
  };
  // In the order of FABRIC_BINDING and those after it.
  [[nodiscard]] std::vector<const Buffer*> buffers() const;
  [[nodiscard]] const std::vector<Page>& pages() const { return pages_; }
  [[nodiscard]] std::uint32_t cells() const { return cells_; }
  [[nodiscard]] std::uint32_t harmonics() const { return harmonics_; }

 private:
  Buffer sizes_;
  Buffer floats_;
  Buffer segments_;
  Buffer ssdf_basis_;
  Buffer ssdf_factors_;
  Buffer gaussians_;
  std::vector<Page> pages_;
  std::uint32_t cells_ = 0;
  std::uint32_t harmonics_ = 0;
};

}  // namespace weft::render::gpu
