#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "render/gpu/device.h"
#include "render/gpu/fabric_tables.h"
#include "render/integrator.h"
#include "render/kernels/shading_records.h"
#include "render/precomputed_fabric.h"

namespace weft::render::gpu {

// The kernels of light, made once for a device.
struct ShadingKernels {
  explicit ShadingKernels(Device& device);

  Kernel light_gaussian;
  Kernel light_drawn;
  Kernel light_cells;
  Kernel multiple;
  Kernel accumulate;
};

// What belongs to the items of a batch besides their hits, and the sums over the samples of a
// band's pixels.
struct BatchBuffers {
  // `capacity` items, `pixels` pixels, fabrics of up to `harmonics` coefficients.
  BatchBuffers(Device& device, std::uint32_t capacity, std::uint32_t pixels,
               std::uint32_t harmonics);
  [[nodiscard]] static std::uint64_t size_bytes(std::uint64_t capacity, std::uint64_t pixels,
                                                std::uint32_t harmonics);

  std::uint32_t capacity;
  Buffer samples;
  Buffer arriving;
  Buffer pixels;
};

// A fabric that one piece of cloth shows.
struct ShadedPiece {
  int cloth = 0;
  int fabric = 0;  // its number in DeviceHit
  const DeviceFabricTables* tables = nullptr;
  bool turned_alike = false;  // directions are turned into the flat fabric by one rotation
  PrecomputedSettings shading;
};

struct ShadingSettings {
  Scattering scattering = Scattering::kAll;
  bool wants_shadow = false;
};

// Light for the hits of one scene, by the estimators of render/precomputed_integrator.h. Multiple
// scattering is gathered over the lights: where every light comes from one direction of the flat
// fabric everywhere, its transfer was computed for all cells beforehand; elsewhere light is
// gathered before the transfer, which is linear, so that one product per hit serves all lights.
class ShadingPass {
 public:
  struct Parts {
    const ShadingKernels* kernels = nullptr;
    std::vector<const Buffer*> solid;  // in the order of solid.glsl
    int cloths = 0;
    std::vector<ShadedPiece> pieces;
    std::vector<shading::DeviceLight> lights;
  };
  // Transfers whose tables would together take more than this are done per hit.
  static constexpr std::uint64_t kMostCellBytes = std::uint64_t{512} << 20;
  // The bytes of the tables that it will make. `entries`: coefficients of all cells and channels,
  // over the pieces that are turned alike.
  [[nodiscard]] static std::uint64_t cell_bytes(std::uint64_t entries,
                                                const std::vector<shading::DeviceLight>& lights);

  // Uploads the lights. What `parts` points to must outlive the pass.
  ShadingPass(Device& device, Parts parts, const ShadingSettings& settings);

  // Transfers the lights to the cells, in submissions of bounded work; once, before the first
  // batch. Calls `should_stop` between them and throws core::Error(kCancelled) when it says so.
  void prepare(const std::function<bool()>& should_stop);

  // Appends what shades the hits of a batch and adds them to the sums of their pixels.
  // `hits`: a DeviceHit for each item.
  void append(const shading::Batch& batch, const Buffer& hits, const BatchBuffers& buffers,
              std::vector<Dispatch>& dispatches) const;

 private:
  struct Piece {
    ShadedPiece shaded;
    bool transferred = false;
    std::vector<Buffer> cells;  // by light, when transferred
  };
  void transfer_to_cells(const Piece& piece, int light, const std::function<bool()>& should_stop);
  [[nodiscard]] Dispatch light_dispatch(const shading::ShadingCall& call, const Piece& piece,
                                        const Buffer& hits, const BatchBuffers& buffers) const;
  [[nodiscard]] shading::ShadingCall call_of(const Piece& piece) const;
  [[nodiscard]] std::vector<const Buffer*> solid_and(const Piece& piece) const;

  Device& device_;
  Parts parts_;
  ShadingSettings settings_;
  Buffer lights_;
  Buffer no_cells_;
  std::vector<Piece> pieces_;
  bool is_prepared_ = false;
};

}  // namespace weft::render::gpu
