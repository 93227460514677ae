#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "render/fabric.h"
#include "render/gpu/device.h"
#include "render/gpu/fabric_tables.h"
#include "render/gpu/grid_cache.h"
#include "render/gpu/shading_pass.h"

namespace weft::render::gpu {

// A device that draws pictures: keeps its kernels, and the tables of the fabrics it has drawn for
// as long as the fabrics live and there is room. One thread, and one drawing at a time.
class DeviceRenderer {
 public:
  // As Device::open. Throws core::Error; kFailedPrecondition where there is no Vulkan driver.
  explicit DeviceRenderer(std::string wanted = {}, const DeviceOptions& options = {});

  [[nodiscard]] const DeviceInfo& info() const { return device_->info(); }
  [[nodiscard]] Device& device() { return *device_; }
  [[nodiscard]] const ShadingKernels& kernels() const { return *kernels_; }
  [[nodiscard]] const Kernel& eye_kernel() const { return *eye_kernel_; }
  // Of the fabrics it has drawn, kept as long as they live.
  [[nodiscard]] GridCache& grids() { return grids_; }

  // The tables of these fabrics, uploaded where they are not kept. `besides_bytes` is what the
  // drawing will allocate too. Fabrics that are gone, and others when room is needed, are dropped
  // first. Throws core::Error(kResourceExhausted) with figures, before anything is uploaded, when
  // all of it does not fit. The pointers hold until the next call. REQUIRES: every fabric has
  // something precomputed.
  [[nodiscard]] std::vector<const DeviceFabricTables*> tables_of(
      const std::vector<const Fabric*>& fabrics, std::uint64_t besides_bytes);
  // How many fabrics are kept.
  [[nodiscard]] std::size_t kept_fabrics() const { return kept_.size(); }

  // Destroys everything on the device and opens it anew, after it was lost. REQUIRES: nothing that
  // a drawing made on it is alive.
  void reopen();

 private:
  struct Kept {
    std::weak_ptr<const void> life;
    std::unique_ptr<DeviceFabricTables> tables;
  };
  void make_kernels();
  void drop_gone_fabrics();

  std::string wanted_;
  DeviceOptions options_;
  std::unique_ptr<Device> device_;
  std::unique_ptr<ShadingKernels> kernels_;
  std::unique_ptr<Kernel> eye_kernel_;
  GridCache grids_;
  std::map<const Fabric*, Kept> kept_;
};

// What `--device` means: nothing for "cpu", and for "auto" where there is no GPU, because the CPU
// draws one and a half to two and a half times as fast as the software device
// (docs/performance.md); else the device of that index or name. Throws as DeviceRenderer.
[[nodiscard]] std::unique_ptr<DeviceRenderer> open_renderer(const std::string& wanted);

}  // namespace weft::render::gpu
