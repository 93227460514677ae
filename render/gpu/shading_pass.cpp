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

std::uint64_t cell_table_bytes(const DeviceFabricTables& tables) {
  return std::uint64_t{tables.cells()} * 3 * tables.harmonics() * sizeof(float);
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

std::uint64_t BatchBuffers::bytes_per_item(std::uint32_t harmonics) {
  return sizeof(shading::DeviceHit) + sizeof(shading::DeviceSample) +
         std::uint64_t{3} * harmonics * sizeof(float);
}

BatchBuffers::BatchBuffers(Device& device, std::uint32_t capacity_, std::uint32_t tile_pixels,
                           std::uint32_t harmonics)
    : capacity(capacity_),
      hits(device.allocate(sizeof(shading::DeviceHit) * std::uint64_t{capacity_}, "hits")),
      samples(device.allocate(sizeof(shading::DeviceSample) * std::uint64_t{capacity_}, "samples")),
      arriving(device.allocate(sizeof(float) * std::uint64_t{3} * harmonics * capacity_,
                               "arriving light")),
      pixels(device.allocate(sizeof(shading::DevicePixel) * std::uint64_t{tile_pixels},
                             "sums of pixels")) {}

std::uint64_t ShadingPass::cell_bytes(const std::vector<ShadedPiece>& pieces,
                                      const std::vector<shading::DeviceLight>& lights) {
  if (!std::all_of(lights.begin(), lights.end(), has_one_direction)) {
    return 0;
  }
  std::uint64_t bytes = 0;
  for (const ShadedPiece& piece : pieces) {
    bytes += piece.turned_alike ? cell_table_bytes(*piece.tables) * lights.size() : 0;
  }
  return bytes <= kMostCellBytes ? bytes : 0;
}

ShadingPass::ShadingPass(Device& device, Parts parts, const ShadingSettings& settings,
                         const std::function<bool()>& should_stop)
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
  const bool transferred = cell_bytes(parts_.pieces, parts_.lights) > 0 &&
                           settings.scattering != Scattering::kSingleOnly;
  for (const ShadedPiece& shaded : parts_.pieces) {
    Piece piece{shaded, transferred && shaded.turned_alike, {}};
    for (std::size_t light = 0; piece.transferred && light < parts_.lights.size(); ++light) {
      piece.cells.push_back(
          device.allocate(cell_table_bytes(*shaded.tables), "light behind its transfer"));
    }
    pieces_.push_back(std::move(piece));
  }
  transfer_to_cells(should_stop);
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
  call.blend_low = settings_.shading.blend_low;
  call.blend_high = settings_.shading.blend_high;
  call.gamma_method = settings_.shading.gamma_method;
  return call;
}

std::vector<const Buffer*> ShadingPass::solid_and(const Piece& piece) const {
  std::vector<const Buffer*> buffers = parts_.solid;
  const std::vector<const Buffer*> fabric = piece.shaded.tables->buffers();
  buffers.insert(buffers.end(), fabric.begin(), fabric.end());
  return buffers;
}

void ShadingPass::transfer_to_cells(const std::function<bool()>& should_stop) {
  for (const Piece& piece : pieces_) {
    for (std::size_t light = 0; light < piece.cells.size(); ++light) {
      ShadingCall call = call_of(piece);
      call.light = static_cast<int>(light);
      for (const DeviceFabricTables::Page& page : piece.shaded.tables->pages()) {
        std::vector<const Buffer*> buffers = solid_and(piece);
        buffers.insert(buffers.end(), {&page.transfer, &lights_, &piece.cells[light]});
        for (std::uint32_t done = 0; done < page.cells; done += kCellsAtOnce) {
          if (should_stop()) {
            throw core::Error(core::Code::kCancelled, "the picture was cancelled");
          }
          call.first_cell = static_cast<int>(page.first_cell);
          call.first_of_page = static_cast<int>(done);
          call.cells = static_cast<int>(std::min(kCellsAtOnce, page.cells - done));
          const Dispatch dispatch = dispatch_of(parts_.kernels->light_cells, buffers, call,
                                                3 * static_cast<std::uint32_t>(call.cells));
          device_.run({&dispatch, 1});
        }
      }
    }
  }
}

void ShadingPass::append_light(const ShadingCall& call, const Piece& piece,
                               const BatchBuffers& buffers,
                               std::vector<Dispatch>& dispatches) const {
  const auto light = static_cast<std::size_t>(call.light);
  std::vector<const Buffer*> bound = solid_and(piece);
  bound.insert(bound.end(), {&buffers.hits, &lights_, &buffers.samples, &buffers.arriving,
                             piece.transferred ? &piece.cells[light] : &no_cells_});
  const bool gaussian = parts_.lights[light].kind == shading::kLightGaussian;
  dispatches.push_back(
      dispatch_of(gaussian ? parts_.kernels->light_gaussian : parts_.kernels->light_drawn,
                  std::move(bound), call, shading::batch_items(call.batch)));
}

void ShadingPass::append(const Batch& batch, const BatchBuffers& buffers,
                         std::vector<Dispatch>& dispatches) const {
  CHECK_LE(shading::batch_items(batch), buffers.capacity);
  ShadingCall call{};
  for (const Piece& piece : pieces_) {
    call = call_of(piece);
    call.batch = batch;
    for (std::size_t light = 0; light < parts_.lights.size(); ++light) {
      call.light = static_cast<int>(light);
      call.is_first = light == 0 ? 1 : 0;
      append_light(call, piece, buffers, dispatches);
    }
    if (settings_.scattering == Scattering::kSingleOnly) {
      continue;
    }
    for (const DeviceFabricTables::Page& page : piece.shaded.tables->pages()) {
      call.first_cell = static_cast<int>(page.first_cell);
      call.cells = static_cast<int>(page.cells);
      std::vector<const Buffer*> bound = solid_and(piece);
      bound.insert(bound.end(),
                   {&page.transfer, &buffers.hits, &buffers.samples, &buffers.arriving});
      dispatches.push_back(dispatch_of(parts_.kernels->multiple, std::move(bound), call,
                                       shading::batch_items(batch)));
    }
  }
  call.batch = batch;
  dispatches.push_back(dispatch_of(parts_.kernels->accumulate,
                                   {&buffers.hits, &buffers.samples, &buffers.pixels}, call,
                                   static_cast<std::uint32_t>(batch.columns * batch.rows)));
}

}  // namespace weft::render::gpu
