#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "render/gpu/device_info.h"
#include "render/gpu/kernel_code.h"

namespace weft::render::gpu {

// Memory of the device that kernels read and write. Freed when destroyed; must not outlive its
// Device.
class Buffer {
 public:
  Buffer();
  ~Buffer();
  Buffer(Buffer&&) noexcept;
  Buffer& operator=(Buffer&&) noexcept;
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;
  [[nodiscard]] std::uint64_t size_bytes() const { return size_bytes_; }

 private:
  friend class Device;
  struct State;
  std::unique_ptr<State> state_;
  std::uint64_t size_bytes_ = 0;
};

// A compute pipeline. Storage buffers are bound to set 0, binding i, in the order of a dispatch.
class Kernel {
 public:
  Kernel();
  ~Kernel();
  Kernel(Kernel&&) noexcept;
  Kernel& operator=(Kernel&&) noexcept;
  Kernel(const Kernel&) = delete;
  Kernel& operator=(const Kernel&) = delete;

 private:
  friend class Device;
  struct State;
  std::unique_ptr<State> state_;
};

// One call of a kernel. A dispatch sees everything that those before it wrote.
struct Dispatch {
  const Kernel* kernel = nullptr;
  std::vector<const Buffer*> buffers{};  // as many as the kernel was made for; none empty
  std::vector<std::byte> push{};         // push constants, as many bytes as the kernel was made for
  std::uint32_t groups_x = 1;
  std::uint32_t groups_y = 1;
};

inline constexpr std::uint32_t kPushBytesLimit = 128;

// The bytes of a plain struct, for Dispatch::push.
template <typename T>
[[nodiscard]] std::vector<std::byte> push_constants(const T& value) {
  static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= kPushBytesLimit);
  std::vector<std::byte> bytes(sizeof(T));
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

enum class Validation {
  kOff,
  kOn,        // the Khronos layer checks every call, core and synchronisation
  kInKernel,  // GPU-assisted: the layer's own code in the kernels checks every access; slow
};

struct DeviceOptions {
  Validation validation = Validation::kOff;
  // Data goes through a staging buffer even where the host sees the device's memory, as it does on
  // a GPU with memory of its own: lets tests walk that way on any device.
  bool always_stage = false;
};

// What a kernel has cost so far, all its dispatches together.
struct KernelTime {
  std::string name{};
  std::uint64_t dispatches = 0;
  double duration_ns = 0;  // on the device; 0 where it cannot tell times
};

// A headless Vulkan compute device. One thread at a time. Every function throws
// core::Error(kResourceExhausted) with figures when memory does not suffice and kUnavailable when
// the device was lost; after that only destruction is allowed.
class Device {
 public:
  // `wanted`: empty or "auto" for the best one (a real GPU where there is one, else the software
  // device), its index in list_devices(), or a part of its name in any case. Throws
  // core::Error(kNotFound) naming the devices there are, kFailedPrecondition without a driver or
  // without the layer that validation needs.
  [[nodiscard]] static std::unique_ptr<Device> open(const std::string& wanted = {},
                                                    const DeviceOptions& options = {});
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  Device(Device&&) = delete;
  Device& operator=(Device&&) = delete;

  [[nodiscard]] const DeviceInfo& info() const;
  // What the validation layer said so far, errors and warnings; empty is good.
  [[nodiscard]] const std::vector<std::string>& complaints() const;
  // Bytes of all buffers alive.
  [[nodiscard]] std::uint64_t used_bytes() const;

  // Throws core::Error(kResourceExhausted) with figures when the size exceeds max_buffer_bytes or
  // what the heap has left. The contents are undefined. REQUIRES: size_bytes > 0.
  [[nodiscard]] Buffer allocate(std::uint64_t size_bytes, const std::string& what);
  // An empty span gives a buffer of 16 zero bytes, so that it can be bound.
  [[nodiscard]] Buffer upload(std::span<const std::byte> bytes, const std::string& what);
  template <typename T>
  [[nodiscard]] Buffer upload(const std::vector<T>& values, const std::string& what) {
    return upload(std::as_bytes(std::span(values)), what);
  }
  void write(Buffer& to, std::uint64_t offset_bytes, std::span<const std::byte> bytes);
  void read(const Buffer& from, std::uint64_t offset_bytes, std::span<std::byte> bytes);
  // The first `count` values.
  template <typename T>
  [[nodiscard]] std::vector<T> download(const Buffer& from, std::size_t count) {
    std::vector<T> values(count);
    read(from, 0, std::as_writable_bytes(std::span(values)));
    return values;
  }
  void fill_zero(Buffer& buffer);

  // `constants` are the specialisation constants 0, 1, 2, ... REQUIRES: push_bytes is a multiple of
  // 4 and at most kPushBytesLimit; the code binds no more than `buffer_count` buffers.
  // Throws core::Error(kResourceExhausted) when the device cannot bind as many.
  [[nodiscard]] Kernel make_kernel(const KernelCode& code, std::uint32_t buffer_count,
                                   std::uint32_t push_bytes,
                                   std::span<const std::uint32_t> constants = {});

  // Runs the dispatches in order as one submission and waits for its end, in slices. Returns the
  // device's nanoseconds for each (zeros where it cannot tell). Callers keep one call to 5 to 50 ms
  // of work, so that they can stop in between and no watchdog fires. Throws
  // core::Error(kResourceExhausted) when a dispatch has more groups than the device takes.
  std::vector<double> run(std::span<const Dispatch> dispatches);
  // Of every kernel that ran since the device was opened, or since the last call that forgets, by
  // name. Kernels of one name count together.
  [[nodiscard]] std::vector<KernelTime> kernel_times() const;
  void forget_kernel_times();

 private:
  friend class Buffer;
  friend class Kernel;
  struct State;
  explicit Device(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace weft::render::gpu
