#include "render/gpu/shading_pass.h"

#include <algorithm>
#include <utility>

#include "core/check.h"
#include "core/error.h"
#include "render/gpu/kernels.h"
#include "render/kernels/hit.h"

namespace weft::render::gpu {
namespace {

using shading::Batch;
using shading::ShadingCall;

static_assert(sizeof(shading::DeviceHit) == 60);
static_assert(sizeof(shading::DeviceLight) == 60);
static_assert(sizeof(shading::DeviceSample) == 32);
static_assert(sizeof(shading::DevicePixel) == 104);
static_assert(sizeof(Batch) == 44);
static_assert(sizeof(ShadingCall) == 96);

constexpr std::uint32_t kGroup = 64;  // invocations, as the kernels say
constexpr std::uint32_t kSolidBuffers = 5;
constexpr std::uint32_t kFabricBuffers = 6;
// Products of one submission: a few milliseconds on a processor.
constexpr std::uint32_t kCellsAtOnce = 512;

std::uint32_t groups_of(std::uint32_t invocations) { return (invocations + kGroup - 1) / kGroup; }

// Whether a light comes from one direction everywhere.
bool has_one_direction(const shading::DeviceLight& light) {
  return light.kind == shading::kLightDirectional || light.kind == shading::kLightGaussian;
}

std::uint64_t table_entries(const DeviceFabricTables& tables) {
  return std::uint64_t{tables.cells()} * 3 * tables.harmonics();
}

Dispatch dispatch_of(const Kernel& kernel, std::vector<const Buffer*> buffers,
                     const ShadingCall& call, std::uint32_t invocations) {
  return {&kernel, std::move(buffers), push_constants(call), groups_of(invocations), 1};
}

}  // namespace

ShadingKernels::ShadingKernels(Device& device)
    : light_gaussian(device.make_kernel(kernels::light_gaussian, kSolidBuffers + kFabricBuffers + 5,
                                        sizeof(ShadingCall))),
      light_drawn(device.make_kernel(kernels::light_drawn, kSolidBuffers + kFabricBuffers + 5,
                                     sizeof(ShadingCall))),
      light_cells(device.make_kernel(kernels::light_cells, kSolidBuffers + kFabricBuffers + 3,
                                     sizeof(ShadingCall))),
      multiple(device.make_kernel(kernels::multiple, kSolidBuffers + kFabricBuffers + 4,
                                  sizeof(ShadingCall))),
      accumulate(device.make_kernel(kernels::accumulate, 3, sizeof(ShadingCall))) {}

std::uint64_t BatchBuffers::size_bytes(std::uint64_t capacity, std::uint64_t pixels,
                                       std::uint32_t harmonics) {
  return capacity * (sizeof(shading::DeviceSample) + std::uint64_t{3} * harmonics * sizeof(float)) +
         pixels * sizeof(shading::DevicePixel);
}

BatchBuffers::BatchBuffers(Device& device, std::uint32_t most_samples, std::uint32_t tile_pixels,
                           std::uint32_t harmonics)
    : capacity(most_samples),
      samples(
          device.allocate(sizeof(shading::DeviceSample) * std::uint64_t{most_samples}, "samples")),
      arriving(device.allocate(sizeof(float) * std::uint64_t{3} * harmonics * most_samples,
                               "arriving light")),
      pixels(device.allocate(sizeof(shading::DevicePixel) * std::uint64_t{tile_pixels},
                             "sums of pixels")) {}

std::uint64_t ShadingPass::cell_bytes(std::uint64_t entries,
                                      const std::vector<shading::DeviceLight>& lights) {
  if (!std::all_of(lights.begin(), lights.end(), has_one_direction)) {
    return 0;
  }
  const std::uint64_t bytes = entries * lights.size() * sizeof(float);
  return bytes <= kMostCellBytes ? bytes : 0;
}

ShadingPass::ShadingPass(Device& device, Parts parts, const ShadingSettings& settings)
    : device_(device),
      parts_(std::move(parts)),
      settings_(settings),
      no_cells_(device.upload(std::vector<float>{}, "no transfer")) {
  CHECK_EQ(parts_.solid.size(), std::size_t{kSolidBuffers});
  if (parts_.lights.empty()) {  // every hit has a light that sets its sums to zero
    parts_.lights.push_back({});
    parts_.lights.back().place = {0, 0, 1};
  }
  lights_ = device.upload(parts_.lights, "lights");
  std::uint64_t entries = 0;
  for (const ShadedPiece& piece : parts_.pieces) {
    entries += piece.turned_alike ? table_entries(*piece.tables) : 0;
  }
  const bool transferred =
      cell_bytes(entries, parts_.lights) > 0 && settings.scattering != Scattering::kSingleOnly;
  for (const ShadedPiece& shaded : parts_.pieces) {
    Piece piece{shaded, transferred && shaded.turned_alike, {}};
    for (std::size_t light = 0; piece.transferred && light < parts_.lights.size(); ++light) {
      piece.cells.push_back(device.allocate(table_entries(*shaded.tables) * sizeof(float),
                                            "light behind its transfer"));
    }
    pieces_.push_back(std::move(piece));
  }
}

ShadingCall ShadingPass::call_of(const Piece& piece) const {
  ShadingCall call{};
  call.cloths = parts_.cloths;
  call.cloth = piece.shaded.cloth;
  call.fabric = piece.shaded.fabric;
  call.transferred = piece.transferred ? 1 : 0;
  call.wanted = (settings_.scattering == Scattering::kMultipleOnly ? 0 : shading::kWantSingle) |
                (settings_.scattering == Scattering::kSingleOnly ? 0 : shading::kWantMultiple) |
                (settings_.wants_shadow ? shading::kWantShadow : 0);
  call.blend_low = piece.shaded.shading.blend_low;
  call.blend_high = piece.shaded.shading.blend_high;
  call.gamma_method = piece.shaded.shading.gamma_method;
  return call;
}

std::vector<const Buffer*> ShadingPass::solid_and(const Piece& piece) const {
  std::vector<const Buffer*> buffers = parts_.solid;
  const std::vector<const Buffer*> fabric = piece.shaded.tables->buffers();
  buffers.insert(buffers.end(), fabric.begin(), fabric.end());
  return buffers;
}

void ShadingPass::prepare(const std::function<bool()>& should_stop) {
  if (is_prepared_) {
    return;
  }
  for (const Piece& piece : pieces_) {
    for (std::size_t light = 0; light < piece.cells.size(); ++light) {
      transfer_to_cells(piece, static_cast<int>(light), should_stop);
    }
  }
  is_prepared_ = true;
}

void ShadingPass::transfer_to_cells(const Piece& piece, int light,
                                    const std::function<bool()>& should_stop) {
  ShadingCall call = call_of(piece);
  call.light = light;
  for (const DeviceFabricTables::Page& page : piece.shaded.tables->pages()) {
    std::vector<const Buffer*> buffers = solid_and(piece);
    buffers.insert(buffers.end(),
                   {&page.transfer, &lights_, &piece.cells[static_cast<std::size_t>(light)]});
    call.first_cell = static_cast<int>(page.first_cell);
    for (std::uint32_t done = 0; done < page.cells; done += kCellsAtOnce) {
      if (should_stop()) {
        throw core::Error(core::Code::kCancelled, "the picture was cancelled");
      }
      const std::uint32_t cells = std::min(kCellsAtOnce, page.cells - done);
      call.first_of_page = static_cast<int>(done);
      call.cells = static_cast<int>(cells);
      const Dispatch dispatch = dispatch_of(parts_.kernels->light_cells, buffers, call, 3 * cells);
      device_.run({&dispatch, 1});
    }
  }
}

Dispatch ShadingPass::light_dispatch(const ShadingCall& call, const Piece& piece,
                                     const Buffer& hits, const BatchBuffers& buffers) const {
  const auto light = static_cast<std::size_t>(call.light);
  std::vector<const Buffer*> bound = solid_and(piece);
  bound.insert(bound.end(), {&hits, &lights_, &buffers.samples, &buffers.arriving,
                             piece.transferred ? &piece.cells[light] : &no_cells_});
  const bool gaussian = parts_.lights[light].kind == shading::kLightGaussian;
  return dispatch_of(gaussian ? parts_.kernels->light_gaussian : parts_.kernels->light_drawn,
                     std::move(bound), call, shading::batch_items(call.batch));
}

void ShadingPass::append(const Batch& batch, const Buffer& hits, const BatchBuffers& buffers,
                         std::vector<Dispatch>& dispatches) const {
  CHECK(is_prepared_);
  CHECK_LE(shading::batch_items(batch), buffers.capacity);
  ShadingCall call{};
  for (const Piece& piece : pieces_) {
    call = call_of(piece);
    call.batch = batch;
    for (std::size_t light = 0; light < parts_.lights.size(); ++light) {
      call.light = static_cast<int>(light);
      call.is_first = light == 0 ? 1 : 0;
      dispatches.push_back(light_dispatch(call, piece, hits, buffers));
    }
    if (settings_.scattering == Scattering::kSingleOnly) {
      continue;
    }
    for (const DeviceFabricTables::Page& page : piece.shaded.tables->pages()) {
      call.first_cell = static_cast<int>(page.first_cell);
      call.cells = static_cast<int>(page.cells);
      std::vector<const Buffer*> bound = solid_and(piece);
      bound.insert(bound.end(), {&page.transfer, &hits, &buffers.samples, &buffers.arriving});
      dispatches.push_back(dispatch_of(parts_.kernels->multiple, std::move(bound), call,
                                       shading::batch_items(batch)));
    }
  }
  call.batch = batch;
  dispatches.push_back(dispatch_of(parts_.kernels->accumulate,
                                   {&hits, &buffers.samples, &buffers.pixels}, call,
                                   static_cast<std::uint32_t>(batch.columns * batch.rows)));
}

}  // namespace weft::render::gpu
