#include "render/gpu/device_renderer.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "core/error.h"
#include "render/gpu/eye_rays.h"

namespace weft::render::gpu {
namespace {

bool has_gpu() {
  try {
    return list_devices().front().kind != DeviceInfo::Kind::kSoftware;
  } catch (const core::Error& error) {
    if (error.code() != core::Code::kFailedPrecondition) {
      throw;
    }
    return false;  // there is no driver at all
  }
}

std::string mebibytes(std::uint64_t bytes) {
  return std::to_string((bytes + (std::uint64_t{1} << 20) - 1) >> 20) + " MiB";
}

}  // namespace

DeviceRenderer::DeviceRenderer(std::string wanted, const DeviceOptions& options)
    : wanted_(std::move(wanted)), options_(options), device_(Device::open(wanted_, options_)) {
  make_kernels();
}

void DeviceRenderer::make_kernels() {
  kernels_ = std::make_unique<ShadingKernels>(*device_);
  eye_kernel_ = std::make_unique<Kernel>(EyeRays::make_kernel(*device_));
}

void DeviceRenderer::reopen() {
  kept_.clear();
  kernels_.reset();
  eye_kernel_.reset();
  device_.reset();
  device_ = Device::open(wanted_, options_);
  make_kernels();
}

void DeviceRenderer::drop_gone_fabrics() {
  for (auto kept = kept_.begin(); kept != kept_.end();) {
    kept = kept->second.life.expired() ? kept_.erase(kept) : std::next(kept);
  }
}

std::vector<const DeviceFabricTables*> DeviceRenderer::tables_of(
    const std::vector<const Fabric*>& fabrics, std::uint64_t besides_bytes) {
  drop_gone_fabrics();
  std::map<const Fabric*, FabricArrays> missing;
  std::uint64_t needed = besides_bytes;
  for (const Fabric* fabric : fabrics) {
    if (!kept_.contains(fabric) && !missing.contains(fabric)) {
      needed += missing.emplace(fabric, pack_fabric(*fabric)).first->second.size_bytes();
    }
  }
  const auto has_room = [&] { return needed + device_->used_bytes() <= info().memory_bytes; };
  for (auto kept = kept_.begin(); kept != kept_.end() && !has_room();) {
    const bool wanted = std::find(fabrics.begin(), fabrics.end(), kept->first) != fabrics.end();
    kept = wanted ? std::next(kept) : kept_.erase(kept);
  }
  if (!has_room()) {
    throw core::Error(core::Code::kResourceExhausted,
                      "the picture takes " + mebibytes(needed) + " beside " +
                          mebibytes(device_->used_bytes()) + " in use, and " + info().name +
                          " has " + mebibytes(info().memory_bytes) +
                          "; use fewer fabrics or smaller ones, or draw with --device cpu");
  }
  for (const auto& [fabric, arrays] : missing) {
    kept_[fabric] = {fabric->life(), std::make_unique<DeviceFabricTables>(*device_, arrays)};
  }
  std::vector<const DeviceFabricTables*> tables;
  for (const Fabric* fabric : fabrics) {
    tables.push_back(kept_.at(fabric).tables.get());
  }
  return tables;
}

std::unique_ptr<DeviceRenderer> open_renderer(const std::string& wanted) {
  if (wanted == "cpu" || (wanted == "auto" && !has_gpu())) {
    return nullptr;
  }
  return std::make_unique<DeviceRenderer>(wanted);
}

}  // namespace weft::render::gpu
